# SPDX-License-Identifier: BSD-2-Clause
"""The names of dynacom 1.2, so that its scripts run unchanged. All of them are here."""

from typing import Any

from dynacom.dynacom_pywrap import Contact6D, ContactBase, ContactPoint, DynaCoM

#: dynacom 1.2's name -> today's.
ALIASES = {
    # Contacts.
    "set_mu": "setMu",
    "set_gu": "setGu",
    "set_force_weights": "setForceWeights",
    "set_torque_weights": "setTorqueWeights",
    "set_surface_half_width": "setSurfaceHalfWidth",
    "set_surface_half_length": "setSurfaceHalfLength",
    "get_frame_id": "getFrameID",
    "set_frame_id": "setFrameID",
    "get_pose": "getPose",
    "update_NE_matrix": "updateNewtonEuler",
    # DynaCoM.
    "model": "getModel",
    "data": "getData",
    # Both: a contact has NE_A, a DynaCoM has NE_A and NE_b.
    "NE_A": "ne_A",
    "NE_b": "ne_b",
}


# Fields that the old interface does not know.
_LATER = (
    *("friction", "facets", "facet_angle", "least_normal_force", "greatest_normal_force"),
    *("placement", "reference", "coupled_yaw"),
)


def get_settings(contact: Any) -> dict[str, Any]:
    """The contact's settings as a dict: name of the old field -> value (a copy)."""
    settings = contact.getSettings()
    fields = [name for name, kind in vars(type(settings)).items() if isinstance(kind, property)]
    return {name: getattr(settings, name) for name in fields if name not in _LATER}


def add_aliases() -> None:
    """Gives the classes their old names, each class those of the methods that it defines itself."""
    for cls in (ContactBase, ContactPoint, Contact6D, DynaCoM):
        for alias, name in ALIASES.items():
            if name in vars(cls):
                setattr(cls, alias, vars(cls)[name])
    for cls in (ContactPoint, Contact6D):
        cls.get_settings = get_settings

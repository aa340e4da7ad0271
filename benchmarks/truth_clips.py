"""Clips whose forces nobody has measured: what their contacts cannot give, and how they slide.

What must be known to read those of other people is in SOURCES.md of ../shared/data and of its
clips/. The bundled walks come with their contacts.
"""

import tempfile
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path

import numpy as np
from truth_metrics import compare_changes, share
from truth_scores import score_verdict

import dynacom

# Contacts that move faster are none [m/s].
FAST = 1.0
# Limits of the verdict, in force and moment [m g], [m g m].
LIMITS = 0.1, 0.03
GRAVITY = 9.81
# The bundled walks, and by how many frames their contacts may be off.
BUNDLED = {"talos_walk": "talos", "anymal_walk": "anymal_c", "anymal_trot": "anymal_c"}
SAME = 2

# The soles are the undersides of the boxes that the feet's collision geometry is.
T1_SOLE = "6d:xyz=0.0101079/0/-0.0432508,half_length=0.112434,half_width=0.05,mu=0.7,gu=0.08"
A1_FOOT = "point:world_aligned=true,radius=0.02,mu=0.7"


@cache
def load_robot(name, folder):
    """The package's robot of this name, or one without a file; `folder` has the clips' own."""
    if name == "t1":
        soles = [f"{side}_foot_link:{T1_SOLE},name={side}_sole" for side in ("left", "right")]
        return dynacom.make_robot(folder / "T1_23dof.urdf", soles)
    if name == "a1":
        feet = [f"{foot}_foot:{A1_FOOT}" for foot in ("FR", "FL", "RR", "RL")]
        return dynacom.make_robot("a1_description/urdf/a1.urdf", feet)
    return dynacom.load_robot(name)


@dataclass(frozen=True)
class Sample:
    """A clip, its robot, and what is to be said to read it."""

    path: str
    robot: str = "g1"
    options: dict = field(default_factory=dict)

    @property
    def name(self):
        return Path(self.path).name


at_60 = partial(Sample, options={"fps": 60})
SAMPLES = (
    at_60("B_HandsUp.csv"),
    Sample("B_HandsUp.npz"),
    at_60("J_Dance0_StepTouch.csv"),
    Sample("sub3_largebox_003_mj.npz"),
    Sample("squat_level1.pkl", options={"trust": True}),
    at_60("clips/M_ShortMove14.csv"),
    at_60("clips/bones_seed_style_M_ShortMove14_fps60.csv"),
    at_60("clips/B_Fence2.csv"),
    at_60("clips/J_Dance5_Hype.csv"),
    at_60("clips/G1_Take_102.bvh_60hz.csv"),
    at_60("clips/G1_Take_102.bvh_60hz_23dof.csv"),
    Sample("clips/airkick_stand.pkl"),
    Sample("clips/output_jumpjack.csv", options={"fps": 30, "quat": "wxyz"}),
    Sample("clips/accad_A3___Swing_t2.pkl"),
    Sample("clips/0807_yanjie_walk_008.pkl"),
    Sample("clips/G1_walk.npz"),
    Sample("clips/02-constspeed_UnitreeG1.npz"),
    Sample("clips/CMU_10_05.npz", "t1"),
    Sample("clips/trot0.txt", "a1"),
    Sample("clips/a1_trot0_amp_fps47.619.csv", "a1", {"fps": 1 / 0.021}),
)


def analyze_sample(sample, data, options=None):
    """What dynacom finds of a clip; `data` is ../shared/data.

    Args:
        options: AnalysisOptions; None for the defaults.

    Raises:
        DynacomError: the clip cannot be read.
    """
    robot = load_robot(sample.robot, data / "clips")
    return dynacom.analyze(
        data / sample.path, robot, options=options, sensitivity=False, **sample.options
    )


def bound_force(report):
    """RMS of the force [m g] that the feet cannot give if all of their parts carry all the time,
    wherever they are: what no schedule of contacts can be far below."""
    parts = dynacom.splitContacts(report.robot.dynacom())
    motion = report.examination.derived.motion
    names = [part.name for part in parts.parts]
    always = dynacom.ContactSchedule(names, np.ones((len(motion.time), len(names)), bool))
    residual = dynacom.analyzeMotion(parts.robot, motion, always).residual[:, :3]
    weight = report.summary["mass"] * GRAVITY
    return float(np.sqrt(np.mean(np.sum(np.square(residual), axis=1)))) / weight


def score_sample(report):
    """Residuals [m g], [m g m]; in %, frames within the verdict's limits and of fast contact."""
    weight = report.summary["mass"] * GRAVITY
    residual = np.linalg.norm(report["residual"].reshape(-1, 2, 3), axis=2) / weight
    names = list(report.robot.contacts)
    active, speed = (
        np.column_stack([report[f"contact.{name}.{what}"] for name in names])
        for what in ("active", "speed")
    )
    active = active.astype(bool)
    return {
        "frames": len(residual),
        "force_rms": report.summary["residual_force_rms"],
        "force_bound": bound_force(report),
        "torque_rms": report.summary["residual_torque_rms"],
        "force_largest": float(residual[:, 0].max()),
        "within": share(int((residual <= LIMITS).all(axis=1).sum()), len(residual)),
        "fast": share(int((active & (speed > FAST)).sum()), int(active.sum())),
        "fastest": float(speed[active].max()) if active.any() else None,
        **score_verdict(report),
    }


def measure(data):
    """The figures of all clips: by name, or why one cannot be read."""
    figures = {}
    for sample in SAMPLES:
        try:
            figures[sample.name] = score_sample(analyze_sample(sample, data))
        except dynacom.DynacomError as error:
            message = str(error).replace(str(data / sample.path), sample.name)
            figures[sample.name] = {"error": message.splitlines()[0][:200]}
    return figures


def measure_walks(folder):
    """How the contacts found in the bundled walks, from q alone, are unlike the planned ones."""
    figures = {}
    for name, robot in BUNDLED.items():
        with np.load(folder / f"{name}.npz") as file, tempfile.TemporaryDirectory() as temporary:
            path = Path(temporary) / f"{name}.npz"
            np.savez(path, t=file["t"], q=file["q"])
            report = dynacom.analyze(path, robot, sensitivity=False)
            names, planned = map(str, file["contact_names"]), file["contacts"]
        found = np.column_stack([report[f"contact.{name}.active"] for name in names])
        figures[name] = compare_changes(found.astype(bool), planned, SAME)
    return figures

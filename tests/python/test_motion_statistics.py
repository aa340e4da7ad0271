# SPDX-License-Identifier: BSD-2-Clause
import numpy as np
import pytest
from numpy.testing import assert_allclose

import dynacom
from dynacom import DistributionStatus, compareMeasured, summarizeMotion
from helpers import WALKS, documentation


@pytest.fixture(scope="module")
def report(talos):
    return dynacom.analyze(WALKS / "talos_walk.npz", talos, sensitivity=False)


def test_statistics_are_those_of_the_arrays(talos, report):
    """By NumPy."""
    statistics = report.examination.statistics
    weight = statistics.mass * 9.81
    assert statistics.frames == len(report["time"])
    assert statistics.weight == pytest.approx(weight)
    assert statistics.mean_vertical_force == pytest.approx(
        report["ground_force"][:, 2].mean() / weight
    )
    velocity = report["vcom"][:, 2]
    duration = report["time"][-1] - report["time"][0]
    assert statistics.momentum_change == pytest.approx(
        statistics.mass * (velocity[-1] - velocity[0]) / duration / weight
    )
    residual = np.linalg.norm(report["residual"].reshape(-1, 2, 3), axis=2) / weight
    force, torque = np.sqrt((residual**2).mean(axis=0))
    assert statistics.residual_force_rms == pytest.approx(force, abs=1e-12)
    assert statistics.residual_torque_rms == pytest.approx(torque, abs=1e-12)
    for status in (DistributionStatus.Solved, DistributionStatus.Relaxed):
        share = np.mean(report["status"] == status.name)
        assert statistics.share(status) == pytest.approx(share)
    assert sum(statistics.statuses.values()) == statistics.frames
    for contact in statistics.contacts:
        part = {
            name: report[f"contact.{contact.name}.{name}"]
            for name in ("active", "friction_usage", "cop_margin")
        }
        (wrench,) = (c for c in report.analysis.contacts if c.name == contact.name)
        vertical = wrench.vertical_force / weight
        assert contact.active_share == pytest.approx(part["active"].mean())
        assert contact.weight_share == pytest.approx(vertical.mean())
        assert contact.weight_share_while_active == pytest.approx(vertical[part["active"]].mean())
        assert contact.largest_vertical_force == pytest.approx(vertical.max())
        assert contact.largest_friction_usage == pytest.approx(np.nanmax(part["friction_usage"]))
        assert contact.least_cop_margin == pytest.approx(np.nanmin(part["cop_margin"]))
    again = summarizeMotion(talos.dynacom(), report.motion, report.analysis, report.verdict)
    assert again.residual_torque_rms == statistics.residual_torque_rms
    assert_allclose(again.mean_residual, statistics.mean_residual)


def test_measured_forces():
    """By NumPy."""
    rng = np.random.default_rng(1)
    measured = rng.standard_normal((50, 3))
    computed = 2.0 * measured + rng.standard_normal((50, 3))
    measured[7, 1] = np.nan
    known = np.arange(50) != 7
    difference = compareMeasured(computed, measured)
    assert difference.frames == 49
    gap = (computed - measured)[known]
    assert_allclose(difference.bias, gap.mean(axis=0))
    assert_allclose(difference.rms, np.sqrt((gap**2).mean(axis=0)))
    expected = [np.corrcoef(computed[known, k], measured[known, k])[0, 1] for k in range(3)]
    assert_allclose(difference.correlation, expected)
    with pytest.raises(ValueError, match="computed must have 49 frames"):
        compareMeasured(computed, measured[1:])


def test_documentation():
    for function in (summarizeMotion, compareMeasured):
        assert "ValueError" in documentation(function)[0]

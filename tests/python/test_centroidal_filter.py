# SPDX-License-Identifier: BSD-2-Clause
"""The distance to feasible, against another solver."""

from pathlib import Path

import clarabel
import numpy as np
import pinocchio
import pytest
import scipy.sparse as sp
import truth_clips

import dynacom
from helpers import WALKS

GRAVITY = 9.81
# So exact that what is left is the other solver's.
EXACT = {"reach": 1e-6, "change": 1e-5, "maximal_iterations": 1e4, "window": 1e3}

FEET = dynacom.AnalysisOptions(feet_only=True)


def filter_settings(**fields):
    settings = dynacom.CentroidalFilterSettings()
    for name, value in fields.items():
        setattr(settings, name, value)
    return settings


def skew(vector):
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def differences(time):
    """Second differences of a path at rest at both ends, rates half a frame before and after, and
    how long frames last: (T, T), (T, T), (T,)."""
    count = len(time)
    step = np.diff(time)
    before, after = np.append(step[:1], step), np.append(step, step[-1:])
    durations = 0.5 * (before + after)
    second, rate = sp.lil_matrix((count, count)), sp.lil_matrix((count, count))
    for k in range(count):
        for other, gap in ((k - 1, before[k]), (k + 1, after[k])):
            if 0 <= other < count:
                second[k, other] += 1.0 / (gap * durations[k])
                second[k, k] -= 1.0 / (gap * durations[k])
        if k + 1 < count:
            rate[k, k] += 1.0 / durations[k]
        if k > 0:
            rate[k, k - 1] -= 1.0 / durations[k]
    return second.tocsr(), rate.tocsr(), durations


class Problem:
    """Changes of a motion and forces of its contacts as a quadratic program.

    Unknown are the displacement of each frame, the angular momentum half a frame later, axis by
    axis, and the forces of what is active. Wrenches are over the weight.
    """

    def __init__(self, report, parts, settings):
        found = report.examination
        weight = found.statistics.mass * GRAVITY
        self.com = found.analysis.com
        self.force = found.analysis.ground_force / weight
        self.torque = found.analysis.ground_torque / weight
        self.active = np.asarray(found.inference.schedule.active)
        self.places = np.array([motion.position for motion in found.part_motions])
        points = [parts.robot.getContact(part.name).getSettings() for part in parts.parts]
        self.mu = [point.mu for point in points]
        self.is_cone = points[0].friction == dynacom.FrictionModel.Cone
        self.second, self.rate, durations = differences(found.analysis.time)
        times = sp.diags(durations)
        displacement = times / settings.com**2
        displacement += self.second.T @ times @ self.second / settings.com_acceleration**2
        momentum = times / settings.angular_momentum**2
        blocks = [displacement] * 3 + [momentum] * 3
        self.cost_matrix = 2.0 * sp.block_diag(blocks, format="csc")

    def cost(self, displacement, momentum):
        x = np.concatenate([*displacement.T, *momentum.T])
        return 0.5 * x @ self.cost_matrix @ x

    def wrenches(self, displacement):
        """Wrenches after changes as (rows, constants), linearised at these displacements."""
        none = sp.csr_matrix(self.second.shape)
        second = self.second / GRAVITY
        accelerations = second @ displacement
        places = [-skew(force) for force in self.force + accelerations]
        of_place = np.array(places)
        of_acceleration = np.array([skew(place) for place in displacement])
        bilinear = np.cross(displacement, accelerations)
        rows, constants = [], [*self.force.T, *(self.torque - bilinear).T]
        for i in range(3):
            rows.append([second if i == j else none for j in range(3)] + [none] * 3)
        for i in range(3):
            by_place = [
                sp.diags(of_place[:, i, j]) + sp.diags(of_acceleration[:, i, j]) @ second
                for j in range(3)
            ]
            rows.append(by_place + [self.rate if i == j else none for j in range(3)])
        return sp.bmat(rows, format="csr"), np.concatenate(constants)

    def forces(self):
        """What forces give, and the rows of (λ_z, λ_x, λ_y), those times μ the first."""
        count = len(self.com)
        frames, parts = np.nonzero(self.active)
        give = sp.lil_matrix((6 * count, 3 * len(frames)))
        limits = sp.lil_matrix((3 * len(frames), 3 * len(frames)))
        for index, (frame, part) in enumerate(zip(frames, parts, strict=True)):
            lever = skew(self.places[part, frame] - self.com[frame])
            for axis in range(3):
                give[axis * count + frame, 3 * index + axis] = 1.0
                for i in range(3):
                    give[(3 + i) * count + frame, 3 * index + axis] = lever[i, axis]
            limits[3 * index, 3 * index + 2] = self.mu[part]
            limits[3 * index + 1, 3 * index] = limits[3 * index + 2, 3 * index + 1] = 1.0
        return give, limits.tocsr()

    def within(self, limits):
        """Rows of which what is negative must be in cones, and these."""
        if self.is_cone:
            return -limits, [clarabel.SecondOrderConeT(3)] * (limits.shape[0] // 3)
        signs = [[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0, 0, 0]]
        pyramid = sp.csr_matrix(np.array(signs) - np.array([1, 0, 0]))
        rows = sp.block_diag([pyramid] * (limits.shape[0] // 3), format="csr") @ limits
        return rows, [clarabel.NonnegativeConeT(rows.shape[0])]

    def least_cost(self, displacement):
        """By Clarabel."""
        count = len(self.com)
        rows, constants = self.wrenches(displacement)
        give, limits = self.forces()
        within, cones = self.within(limits)
        # There is no angular momentum half a frame behind the last one.
        last = sp.lil_matrix((3, 6 * count))
        for axis in range(3):
            last[axis, (4 + axis) * count - 1] = 1.0
        matrix = sp.bmat([[rows, -give], [last, None], [None, within]], format="csc")
        rhs = np.concatenate([-constants, np.zeros(3 + within.shape[0])])
        cost = sp.block_diag([self.cost_matrix, sp.csc_matrix((give.shape[1],) * 2)])
        options = clarabel.DefaultSettings()
        options.verbose = False
        solution = clarabel.DefaultSolver(
            sp.triu(cost, format="csc"),
            np.zeros(cost.shape[0]),
            matrix,
            rhs,
            [clarabel.ZeroConeT(6 * count + 3), *cones],
            options,
        ).solve()
        assert str(solution.status) == "Solved"
        return solution.obj_val


def half_frames(momentum):
    """Of the means of the half frames around each frame."""
    half = np.zeros_like(momentum)
    for k in range(len(momentum) - 1):
        half[k] = 2.0 * momentum[k] - (half[k - 1] if k else 0.0)
    return half


def find_change(report, settings, friction):
    found = report.examination
    robot = report.robot.dynacom()
    parts = dynacom.splitContacts(robot, friction=friction)
    change = dynacom.distanceToFeasible(
        parts, found.part_motions, found.analysis, found.inference.schedule, settings
    )
    return parts, change


def compare(report, friction=dynacom.FrictionModel.OuterPyramid):
    """Checks that no change of a motion is cheaper than the one that is found."""
    settings = filter_settings(**EXACT)
    parts, change = find_change(report, settings, friction)
    assert change.converged
    assert change.largest > 1e-3
    problem = Problem(report, parts, settings)
    assert problem.is_cone == (friction == dynacom.FrictionModel.Cone)
    momentum = half_frames(change.angular_momentum)
    cost = problem.cost(change.com, momentum / (report.examination.statistics.mass * GRAVITY))
    assert cost == pytest.approx(problem.least_cost(change.com), rel=1e-4)


FRICTION = [dynacom.FrictionModel.OuterPyramid, dynacom.FrictionModel.Cone]


def perturbed(walk: str, robot: str, tmp_path: Path, seed: int, speed: float, sway: float) -> Path:
    """A bundled walk, played at another speed, that sways where it did not."""
    with np.load(WALKS / f"{walk}.npz") as file:
        time, q = file["t"][:240:3], file["q"][:240:3]
    model = dynacom.load_robot(robot).model
    rng = np.random.default_rng(seed)
    phase, size = rng.uniform(0.0, 6.0, model.nv), rng.uniform(-sway, sway, model.nv)
    steps = size * np.sin(4.0 * time[:, None] + phase)
    moved = [pinocchio.integrate(model, *pair) for pair in zip(q, steps, strict=True)]
    path = tmp_path / f"{walk}.npz"
    np.savez(path, t=time / speed, q=moved)
    return path


@pytest.mark.parametrize("friction", FRICTION)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("walk", "robot", "sway"),
    [
        ("talos_walk", "talos", 0.03),
        ("anymal_walk", "anymal_c", 0.06),
        ("anymal_trot", "anymal_c", 0.06),
    ],
)
def test_no_change_of_a_walk_is_cheaper(walk, robot, sway, tmp_path, seed, friction):
    path = perturbed(walk, robot, tmp_path, seed, 1.0 + 0.3 * seed, sway)
    compare(dynacom.analyze(path, robot, options=FEET, sensitivity=False), friction)


# All that can be read, but a squat that is close to feasible.
CLIPS = [
    "B_HandsUp.csv",
    "J_Dance0_StepTouch.csv",
    "sub3_largebox_003_mj.npz",
    "M_ShortMove14.csv",
    "B_Fence2.csv",
    "J_Dance5_Hype.csv",
    "G1_Take_102.bvh_60hz.csv",
    "G1_Take_102.bvh_60hz_23dof.csv",
    "airkick_stand.pkl",
    "output_jumpjack.csv",
    "accad_A3___Swing_t2.pkl",
    "0807_yanjie_walk_008.pkl",
    "a1_trot0_amp_fps47.619.csv",
]


@pytest.mark.parametrize("friction", FRICTION)
@pytest.mark.parametrize("name", CLIPS)
def test_no_change_of_a_clip_is_cheaper(shared_data, name, friction):
    (sample,) = (sample for sample in truth_clips.SAMPLES if sample.name == name)
    compare(truth_clips.analyze_sample(sample, shared_data, FEET), friction)

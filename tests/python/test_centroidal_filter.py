# SPDX-License-Identifier: BSD-2-Clause
"""The distance to feasible, against another solver."""

import clarabel
import numpy as np
import pytest
import scipy.sparse as sp
from helpers import WALKS

import dynacom

GRAVITY = 9.81
EXACT = {"reach": 1e-7, "change": 1e-6, "maximal_iterations": 20000.0, "window": 1e3}


def filter_settings(**fields):
    settings = dynacom.CentroidalFilterSettings()
    for name, value in fields.items():
        setattr(settings, name, value)
    return settings


def skew(vector):
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


class Problem:
    """Changes of a motion and forces of its contacts as a quadratic program.

    Unknown are the displacement in each frame, the angular momentum half a frame later, but for the
    last one, and the forces of what is active. Wrenches are over the weight.
    """

    def __init__(self, report, settings, frames):
        found = report.examination
        self.settings = settings
        self.time = found.analysis.time[frames]
        self.count = len(self.time)
        self.com = found.analysis.com[frames]
        weight = found.statistics.mass * GRAVITY
        self.force = found.analysis.ground_force[frames] / weight
        self.torque = found.analysis.ground_torque[frames] / weight
        self.active = np.asarray(found.inference.schedule.active)[frames]
        self.places = np.array([motion.position[frames] for motion in found.part_motions])
        self.mu = [
            report.robot.contacts[list(report.robot.contacts)[part.contact]].mu
            for part in found.parts
        ]
        step = np.diff(self.time)
        before = np.append(step[:1], step)
        after = np.append(step, step[-1:])
        self.durations = 0.5 * (before + after)
        n = self.count
        second = sp.lil_matrix((n, n))
        rate = sp.lil_matrix((n, n))
        for k in range(n):
            for other, gap in ((k - 1, before[k]), (k + 1, after[k])):
                if 0 <= other < n:
                    second[k, other] += 1.0 / (gap * self.durations[k])
                    second[k, k] -= 1.0 / (gap * self.durations[k])
            if k + 1 < n:
                rate[k, k] += 1.0 / self.durations[k]
            if k > 0:
                rate[k, k - 1] -= 1.0 / self.durations[k]
        self.second, self.rate = second.tocsr(), rate.tocsr()

    def cost_matrix(self):
        s = self.settings
        times = sp.diags(self.durations)
        displacement = times / s.com**2
        displacement += self.second.T @ times @ self.second / s.com_acceleration**2
        momentum = times / s.angular_momentum**2
        blocks = [displacement] * 3 + [momentum] * 3
        return 2.0 * sp.block_diag(blocks, format="csc")

    def cost(self, displacement, momentum):
        x = np.concatenate([*displacement.T, *momentum.T])
        return 0.5 * x @ self.cost_matrix() @ x

    def wrench_rows(self, displacement):
        """How wrenches change, and what is constant, where displacements change these."""
        n = self.count
        accelerations = self.second @ displacement / GRAVITY
        rows = [
            sp.hstack([*(self.second / GRAVITY if i == j else sp.csr_matrix((n, n)) for j in range(3)),
                       *[sp.csr_matrix((n, n))] * 3])
            for i in range(3)
        ]  # fmt: skip
        constants = list(self.force.T)
        of_place = np.array([-skew(f + a) for f, a in zip(self.force, accelerations, strict=True)])
        of_acceleration = np.array([skew(d) for d in displacement])
        bilinear = np.cross(displacement, accelerations)
        for i in range(3):
            parts = [
                sp.diags(of_place[:, i, j]) + sp.diags(of_acceleration[:, i, j]) @ self.second / GRAVITY
                for j in range(3)
            ]  # fmt: skip
            rates = [self.rate if i == j else sp.csr_matrix((n, n)) for j in range(3)]
            rows.append(sp.hstack([*parts, *rates]))
            constants.append(self.torque[:, i] - bilinear[:, i])
        return rows, constants

    def least_cost(self, displacement):
        """By Clarabel, with what is bilinear linearised at these displacements."""
        n = self.count
        rows, constants = self.wrench_rows(displacement)
        frames, parts = np.nonzero(self.active)
        forces = 3 * len(frames)
        given = [sp.lil_matrix((n, forces)) for _ in range(6)]
        within = sp.lil_matrix((5 * len(frames), forces))
        for index, (frame, part) in enumerate(zip(frames, parts, strict=True)):
            lever = skew(self.places[part, frame] - self.com[frame])
            for axis in range(3):
                given[axis][frame, 3 * index + axis] = 1.0
                for i in range(3):
                    given[3 + i][frame, 3 * index + axis] = lever[i, axis]
            mu = self.mu[part]
            for row, (axis, sign) in enumerate(((0, 1), (0, -1), (1, 1), (1, -1))):
                within[5 * index + row, 3 * index + axis] = sign
                within[5 * index + row, 3 * index + 2] = -mu
            within[5 * index + 4, 3 * index + 2] = -1.0
        equations = sp.vstack([sp.hstack([r, -g]) for r, g in zip(rows, given, strict=True)])
        inequalities = sp.hstack([sp.csr_matrix((within.shape[0], 6 * n)), within])
        unused = sp.csr_matrix(([1.0], ([0], [3 * n + n - 1])), (1, 6 * n + forces))
        unused = sp.vstack([unused, *[
            sp.csr_matrix(([1.0], ([0], [k * n + n - 1])), (1, 6 * n + forces)) for k in (4, 5)
        ]])  # fmt: skip
        matrix = sp.vstack([equations, unused, inequalities], format="csc")
        rhs = np.concatenate([-np.concatenate(constants), np.zeros(3 + within.shape[0])])
        cost = sp.block_diag([self.cost_matrix(), sp.csc_matrix((forces, forces))], format="csc")
        options = clarabel.DefaultSettings()
        options.verbose = False
        cones = [clarabel.ZeroConeT(6 * n + 3), clarabel.NonnegativeConeT(within.shape[0])]
        solution = clarabel.DefaultSolver(
            sp.triu(cost, format="csc"), np.zeros(cost.shape[0]), matrix, rhs, cones, options
        ).solve()
        assert str(solution.status) == "Solved"
        return solution.obj_val


def half_frames(momentum):
    """Of what is the mean of the half frames around each frame."""
    half = np.zeros_like(momentum)
    for k in range(len(momentum) - 1):
        half[k] = 2.0 * momentum[k] - (half[k - 1] if k else 0.0)
    return half


def compare(report, frames=slice(None)):
    """The filter's cost, and the least that there is, of some frames of a motion."""
    settings = filter_settings(**EXACT)
    problem = Problem(report, settings, frames)
    found = report.examination
    dynamics, motions = found.analysis.copy(), [m.copy() for m in found.part_motions]
    del dynamics, motions
    change = dynacom.distanceToFeasible(
        dynacom.splitContacts(report.robot.dynacom()),
        found.part_motions,
        found.analysis,
        found.inference.schedule,
        settings,
    )
    assert change.converged
    momentum = half_frames(change.angular_momentum) / (found.statistics.mass * GRAVITY)
    own = problem.cost(change.com, momentum)
    return change, own, problem.least_cost(change.com)

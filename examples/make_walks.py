"""Plan the motions in ``examples/data`` with crocoddyl: walks of Talos and ANYmal, ANYmal's trot.

DynaCoM does not need crocoddyl: the examples only read the files that this script has written. To
write them again, give crocoddyl an environment of its own::

    python3 -m venv croc
    croc/bin/pip install crocoddyl==3.2.1 pin==4.0.0
    croc/bin/python examples/make_walks.py --robots ROBOTS

The wheel of crocoddyl 3.2.1 was built against pin 4.0 and is not ABI-compatible with pin 4.1: ask
for both versions as above, and for nothing that needs a newer pin. ``ROBOTS`` is the folder
``cmeel.prefix/share/example-robot-data/robots`` of the PyPI package ``example-robot-data`` 6.0.0;
without ``--robots`` the one on ``sys.path`` is taken (crocoddyl brings that of 5.0.0, where the
URDFs and SRDFs of these two robots are the same).

Each motion comes from the simple gait problems of ``crocoddyl.utils``. Its cycles are planned one
after the other, each from the state in which the last one ends. With a halt added they are then
solved once more as a single problem, from that first guess, so that each step prepares the next.
:class:`Feasible` tells what is changed in the problems of crocoddyl, and why.

There are no impulses. Crocoddyl ends each step with an impulse, an instant of which the
acceleration is not defined; here the step ends with a knot like all the others, the first with the
foot on the ground, which asks that the foot be in its place and at rest. (The pseudo-impulses of
``crocoddyl.utils`` would not do: they last no time, and the Euler model of crocoddyl 3.2.1
multiplies their cost by that.) So no knot had to be dropped, the time line is uniform, and the rows
obey ``v[k+1] = v[k] + a[k] dt`` and ``q[k+1] = q[k] + v[k+1] dt``.

A file holds, for T instants and C contacts:

``t`` (T,)
    seconds
``q`` (T, nq), ``v`` (T, nv), ``a`` (T, nv)
    configuration (free-flyer first, its quaternion x y z w), velocity and acceleration
``contacts`` (T, C)
    which contacts are active
``contact_names`` (C,), ``contact_frames`` (C,)
    what they are called, and their frames in the URDF
``contact_wrenches`` (T, C, 6)
    force, then moment, that crocoddyl solved for: in the axes of the contact's frame, about its
    origin, zero where the contact is not active
``meta`` ()
    a JSON string: where all this comes from

The ground is z = 0. Nothing is written unless the motion passes all of :func:`check`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

# Before crocoddyl is loaded: on a busy machine its threads wait for each other most of the time.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import crocoddyl
import numpy as np
import pinocchio
from crocoddyl.utils.biped import SimpleBipedGaitProblem
from crocoddyl.utils.quadruped import SimpleQuadrupedalGaitProblem

FRICTION = 0.7  # coefficient of every contact
YAW = 0.08  # of a sole: moment about the normal that 1 N of normal force can hold, in metres


@dataclass(frozen=True)
class Robot:
    """A robot of ``example-robot-data``, and what it stands on."""

    urdf: str
    srdf: str
    reference: str  # the configuration of the SRDF in which the motion begins
    contacts: dict[str, str]  # name of each contact, and its frame
    feet: tuple[str, ...]  # those frames, in the order that crocoddyl's problem takes them
    frame_height: float  # of those frames above the ground
    sole: tuple[float, float] | None  # half length and half width, or None for points
    joints: dict[str, float] = field(default_factory=dict)  # set otherwise than in the reference


@dataclass(frozen=True)
class Gait:
    """A motion: how many cycles, of what kind."""

    robot: Robot
    cycle: str  # the method of crocoddyl's problem that makes one cycle
    cycles: int
    step_length: float
    step_height: float
    step_knots: int  # with a foot in the air
    support_knots: int  # with all the feet on the ground, between the steps
    halt_knots: int  # with all the feet on the ground, at the end
    least_contacts: int  # at any time
    timestep: float = 0.02


TALOS = Robot(
    urdf="talos_data/robots/talos_reduced.urdf",
    srdf="talos_data/srdf/talos.srdf",
    reference="half_sitting",
    contacts={"left_sole": "left_sole_link", "right_sole": "right_sole_link"},
    feet=("right_sole_link", "left_sole_link"),
    frame_height=0.0,
    sole=(0.10, 0.06),
    # The reference rolls the ankles by 0.0017 rad: the soles would not begin quite flat.
    joints={"leg_left_6_joint": 0.0, "leg_right_6_joint": 0.0},
)

ANYMAL_FEET = ("LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT")
ANYMAL = Robot(
    urdf="anymal_c_simple_description/urdf/anymal.urdf",
    srdf="anymal_c_simple_description/srdf/anymal.srdf",
    reference="standing",
    contacts={foot: foot for foot in ANYMAL_FEET},
    feet=ANYMAL_FEET,
    # The feet are spheres of radius 0.03 m in the URDF. Their centres lie 0.0225 m up the shanks
    # from these frames, about which crocoddyl's contact forces have no moment: at this height of
    # the frames the spheres touch the ground, within 2 mm, as the shanks incline.
    frame_height=0.0086,
    sole=None,
)

GAITS = {
    "talos_walk": Gait(
        TALOS,
        "createWalkingProblem",
        cycles=3,
        step_length=0.3,
        step_height=0.08,
        step_knots=35,
        support_knots=12,
        halt_knots=30,
        least_contacts=1,
    ),
    "anymal_walk": Gait(
        ANYMAL,
        "createWalkingProblem",
        cycles=3,
        step_length=0.2,
        step_height=0.08,
        step_knots=25,
        support_knots=6,
        halt_knots=30,
        least_contacts=3,
    ),
    "anymal_trot": Gait(
        ANYMAL,
        "createTrottingProblem",
        cycles=4,
        step_length=0.2,
        step_height=0.08,
        step_knots=15,
        support_knots=4,
        halt_knots=30,
        least_contacts=2,
    ),
}


class Feasible:
    """Changes to crocoddyl's gait problems, so that the contacts can bear what is asked of them.

    As they come, those problems hold the centre of mass to a line midway between the feet, at any
    cost in contact forces. Here the cones of the contacts count for more, and they are narrower
    than the contacts really are, which leaves a margin. The centre of mass is drawn forward and
    held at its height, but is nearly free to sway. The feet follow smooth curves, which end at rest
    on the ground: crocoddyl's triangles end above it, in full fall. And what is not a leg stays
    near its posture, or the arms would swing past their limits.
    """

    com_weight = 1e4
    com_axes = np.array([1.0, 0.1, 100.0])
    cone_weight = 1e3
    cone_share = 0.6  # of the sole's half lengths
    least_load = 0.05  # of each foot on the ground, for each newton of its share of the weight
    posture_weight = 5e2
    # What crocoddyl's pseudo-impulses ask for, of one time step, as costs are per second.
    landing_weight = 1e8 / 0.02
    rest_weight = 1e6 / 0.02

    def __init__(self, robot: Robot, model: pinocchio.Model) -> None:
        super().__init__(model, *robot.feet)
        self.mu = FRICTION
        self.feet = robot.feet
        self.sole = robot.sole
        self.frame_height = robot.frame_height
        q = model.referenceConfigurations[robot.reference]
        self.com_height = pinocchio.centerOfMass(model, self.rdata, q)[2]
        self.idle = np.ones(model.nv)  # 1 for the joints that carry no foot
        for foot in robot.feet:
            for joint in model.supports[model.frames[model.getFrameId(foot)].parentJoint]:
                start = model.joints[joint].idx_v
                self.idle[start : start + model.joints[joint].nv] = 0.0
        weight = pinocchio.computeTotalMass(model) * np.linalg.norm(model.gravity.linear)
        self.least_force = self.least_load * weight / len(robot.feet)

    def add_cost(
        self,
        action: crocoddyl.ActionModelAbstract,
        name: str,
        weight: float,
        residual: crocoddyl.ResidualModelAbstract,
        activation: crocoddyl.ActivationModelAbstract,
    ) -> None:
        """Add one cost to a knot."""
        cost = crocoddyl.CostModelResidual(self.state, activation, residual)
        action.differential.costs.addCost(name, cost, weight)

    # From here on, the names are crocoddyl's.

    def createSwingFootModel(
        self,
        timeStep: float,
        supportFootIds: Sequence[int],
        comTask: np.ndarray | None = None,
        swingFootTask: list | None = None,
    ) -> crocoddyl.IntegratedActionModelEuler:
        """Make a knot, with other costs for the centre of mass and for the contact forces."""
        knot = super().createSwingFootModel(timeStep, supportFootIds, None, swingFootTask)
        if comTask is None:
            target, axes = np.array([0.0, 0.0, self.com_height]), self.com_axes * [0.0, 0.0, 1.0]
        else:
            target, axes = np.array([*comTask[:2], self.com_height]), self.com_axes
        self.add_cost(
            knot,
            "com",
            self.com_weight,
            crocoddyl.ResidualModelCoMPosition(self.state, target, knot.nu),
            crocoddyl.ActivationModelWeightedQuad(axes),
        )
        if self.idle.any():
            self.add_cost(
                knot,
                "posture",
                self.posture_weight,
                crocoddyl.ResidualModelState(self.state, self.rmodel.defaultState, knot.nu),
                crocoddyl.ActivationModelWeightedQuad(np.append(self.idle, 0.0 * self.idle)),
            )
        for foot in supportFootIds:
            name = self.rmodel.frames[foot].name
            if self.sole is None:
                knot.differential.costs.removeCost(name + "_frictionCone")
                cone = crocoddyl.FrictionCone(self.Rsurf, self.mu, 4, True, self.least_force)
                residual = crocoddyl.ResidualModelContactFrictionCone(
                    self.state, foot, cone, knot.nu, True
                )
            else:
                knot.differential.costs.removeCost(name + "_wrenchCone")
                box = 2.0 * self.cone_share * np.array(self.sole)  # crocoddyl takes whole lengths
                cone = crocoddyl.WrenchCone(self.Rsurf, self.mu, box, 4, True, self.least_force)
                residual = crocoddyl.ResidualModelContactWrenchCone(
                    self.state, foot, cone, knot.nu, True
                )
            bounds = crocoddyl.ActivationBounds(cone.lb, cone.ub)
            barrier = crocoddyl.ActivationModelQuadraticBarrier(bounds)
            self.add_cost(knot, name + "_cone", self.cone_weight, residual, barrier)
        return knot

    def createFootstepModels(
        self,
        comPos0: np.ndarray,
        feetPos0: list[np.ndarray],
        stepLength: float,
        stepHeight: float,
        timeStep: float,
        numKnots: int,
        supportFootIds: list[int],
        swingFootIds: list[int],
    ) -> list[crocoddyl.IntegratedActionModelEuler]:
        """Make the knots of one step: those in the air, and the one of the landing.

        As crocoddyl expects, ``comPos0`` and ``feetPos0`` are moved to where the step ends.
        """
        com_length = stepLength * len(swingFootIds) / (len(supportFootIds) + len(swingFootIds))
        for foot in feetPos0:
            foot[2] = self.frame_height
        knots = []
        for phase in np.arange(numKnots + 1) / numKnots:
            forward = phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2)
            up = (4.0 * phase * (1.0 - phase)) ** 3
            move = np.array([stepLength * forward, 0.0, stepHeight * up])
            task = [
                [i, pinocchio.SE3(np.eye(3), p + move)]
                for i, p in zip(swingFootIds, feetPos0, strict=True)
            ]
            landed = swingFootIds if phase == 1.0 else []
            com = comPos0 + np.array([com_length * phase, 0.0, 0.0])
            knots.append(self.createSwingFootModel(timeStep, supportFootIds + landed, com, task))
        for i in swingFootIds:
            name = self.rmodel.frames[i].name
            knots[-1].differential.costs.costs[name + "_footTrack"].weight = self.landing_weight
            axes = np.array([1.0] * 3 + [0.0 if self.sole is None else 1.0] * 3)
            self.add_cost(
                knots[-1],
                name + "_rest",
                self.rest_weight,
                crocoddyl.ResidualModelFrameVelocity(
                    self.state,
                    i,
                    pinocchio.Motion.Zero(),
                    pinocchio.LOCAL_WORLD_ALIGNED,
                    knots[-1].nu,
                ),
                crocoddyl.ActivationModelWeightedQuad(axes),
            )
        comPos0 += [com_length, 0.0, 0.0]
        for foot in feetPos0:
            foot += [stepLength, 0.0, 0.0]
        return knots

    def stand(self, timestep: float, knots: int, x: np.ndarray) -> list:
        """Make knots with all the feet on the ground; the last ten ask for rest."""
        feet = [self.rmodel.getFrameId(name) for name in self.feet]
        pinocchio.framesForwardKinematics(self.rmodel, self.rdata, x[: self.rmodel.nq])
        middle = np.mean([self.rdata.oMf[foot].translation for foot in feet], axis=0)
        models = [self.createSwingFootModel(timestep, feet, middle) for _ in range(knots)]
        for model in models[-10:]:
            self.add_cost(
                model,
                "rest",
                self.rest_weight,
                crocoddyl.ResidualModelState(self.state, self.rmodel.defaultState, model.nu),
                crocoddyl.ActivationModelWeightedQuad(np.repeat([0.0, 1.0], self.rmodel.nv)),
            )
        return models


class Biped(Feasible, SimpleBipedGaitProblem):
    """The biped of crocoddyl, with those changes."""


class Quadruped(Feasible, SimpleQuadrupedalGaitProblem):
    """The quadruped of crocoddyl, with those changes."""


def load(robot: Robot, robots: Path) -> pinocchio.Model:
    """Build the model. In its reference configuration the robot stands on the ground."""
    model = pinocchio.buildModelFromUrdf(str(robots / robot.urdf), pinocchio.JointModelFreeFlyer())
    pinocchio.loadReferenceConfigurations(model, str(robots / robot.srdf), False)
    q = model.referenceConfigurations[robot.reference].copy()
    for joint, angle in robot.joints.items():
        q[model.joints[model.getJointId(joint)].idx_q] = angle
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, q)
    heights = [data.oMf[model.getFrameId(foot)].translation[2] for foot in robot.feet]
    q[2] += robot.frame_height - np.mean(heights)
    model.referenceConfigurations[robot.reference] = q
    return model


def solve(
    knots: list, xs: list[np.ndarray], us: list[np.ndarray] | None = None
) -> crocoddyl.SolverFDDP:
    """Solve for the motion over ``knots`` from ``xs[0]``; the last knot has no duration."""
    shooting = crocoddyl.ShootingProblem(xs[0], knots[:-1], knots[-1])
    shooting.nthreads = 1
    solver = crocoddyl.SolverFDDP(shooting)
    solver.th_stop = 1e-7
    if us is None:
        xs = [xs[0]] * len(knots)
        us = shooting.quasiStatic(xs[:-1])
    if not solver.solve(xs, us, 300):
        raise RuntimeError(f"no solution: stopped at {solver.stop:.1e} after {solver.iter} steps")
    shooting.calc(solver.xs, solver.us)
    return solver


def plan(gait: Gait, model: pinocchio.Model) -> crocoddyl.SolverFDDP:
    """Plan the whole motion."""
    robot = gait.robot
    problem = (Biped if len(robot.feet) == 2 else Quadruped)(robot, model)
    q = model.referenceConfigurations[robot.reference]
    knots, xs, us = [], [np.concatenate([q, np.zeros(model.nv)])], []
    for part in range(gait.cycles + 1):
        stand = problem.stand(gait.timestep, gait.halt_knots + 1, xs[-1])
        if part < gait.cycles:
            cycle = getattr(problem, gait.cycle)(
                xs[-1],
                gait.step_length,
                gait.step_height,
                gait.timestep,
                gait.step_knots,
                gait.support_knots,
            )
            added = [*cycle.runningModels, cycle.terminalModel, stand[0]]
        else:
            added = stand
        solver = solve(added, xs[-1:])
        knots += added[:-1]
        xs += [np.array(x) for x in solver.xs][1:]
        us += [np.array(u) for u in solver.us]
    return solve([*knots, stand[-1]], xs, us)


def sample(gait: Gait, model: pinocchio.Model, solver: crocoddyl.SolverFDDP) -> dict[str, Any]:
    """Read what the file is to hold from the solution: one row for each knot with a duration."""
    frames = list(gait.robot.contacts.values())
    x = np.array([np.array(x) for x in solver.xs])[:-1]
    a = np.zeros((len(x), model.nv))
    contacts = np.zeros((len(x), len(frames)), dtype=bool)
    wrenches = np.zeros((len(x), len(frames), 6))
    for k, data in enumerate(solver.problem.runningDatas):
        a[k] = data.differential.xout
        for name, contact in data.differential.multibody.contacts.contacts.todict().items():
            i = frames.index(name.removesuffix("_contact"))
            contacts[k, i] = True
            # fext acts on the joint and is given in its frame, jMf is the contact's frame there.
            wrenches[k, i] = contact.jMf.actInv(contact.fext).vector
    return {
        "t": gait.timestep * np.arange(len(x)),
        "q": x[:, : model.nq],
        "v": x[:, model.nq :],
        "a": a,
        "contacts": contacts,
        "contact_names": np.array(list(gait.robot.contacts)),
        "contact_frames": np.array(frames),
        "contact_wrenches": wrenches,
    }


def check(gait: Gait, model: pinocchio.Model, rows: dict[str, Any]) -> bool:
    """Print how far the motion is from what it ought to be; tell whether that is near enough."""
    robot = gait.robot
    t, q, v, a, contacts = (rows[key] for key in ("t", "q", "v", "a", "contacts"))
    wrenches = rows["contact_wrenches"]
    frames = [model.getFrameId(name) for name in rows["contact_frames"]]
    data = model.createData()
    mass = pinocchio.computeTotalMass(model)
    gravity = model.gravity.linear

    lacks, speeds, turns, heights, loads = [], [], [], [], []
    cone: dict[str, list[float]] = {"friction": []}
    if robot.sole is not None:
        cone |= {"moment about x": [], "moment about y": [], "moment about z": []}
    for k in range(len(t)):
        pinocchio.computeCentroidalMomentumTimeVariation(model, data, q[k], v[k], a[k])
        pinocchio.updateFramePlacements(model, data)
        lack = data.dhg.vector.copy()
        lack[:3] -= mass * gravity
        com = data.com[0].copy()
        for i in range(len(frames)):
            foot = data.oMf[frames[i]]
            wrench = pinocchio.Force(wrenches[k, i])
            force = foot.rotation @ wrench.linear
            moment = foot.rotation @ wrench.angular
            lack -= np.concatenate([force, moment + np.cross(foot.translation - com, force)])
            if not contacts[k, i]:
                continue
            velocity = pinocchio.getFrameVelocity(model, data, frames[i], pinocchio.LOCAL)
            speeds.append(np.linalg.norm(velocity.linear))
            heights.append(foot.translation[2] - robot.frame_height)
            if robot.sole is None:  # the foot rolls with the shank: the ground is the world's
                f = force
            else:
                f = wrench.linear
                turns.append(np.linalg.norm(velocity.angular))
                limits = (robot.sole[1], robot.sole[0], YAW)
                for axis, limit, component in zip("xyz", limits, wrench.angular, strict=True):
                    cone[f"moment about {axis}"].append(abs(component) / (limit * f[2]))
            loads.append(f[2])
            cone["friction"].append(np.abs(f[:2]).max() / (FRICTION * f[2]))
        lacks.append(np.abs(lack).max() / (mass * np.linalg.norm(gravity)))

    dt = gait.timestep
    moved = [
        pinocchio.difference(model, pinocchio.integrate(model, q0, dt * v1), q1)
        for q0, v1, q1 in zip(q[:-1], v[1:], q[1:], strict=True)
    ]
    low, high = model.lowerPositionLimit[7:], model.upperPositionLimit[7:]
    excess = max(np.max(low - q[:, 7:]), np.max(q[:, 7:] - high))
    numbers = [t, q, v, a, wrenches]
    results = [  # what, how much of it there is, and how much there may be
        ("numbers that are not finite", sum(np.sum(~np.isfinite(x)) for x in numbers), 0),
        ("unevenness of the time line, s", np.abs(np.diff(t) - dt).max(), 1e-12),
        ("forces less the motion's, of m g", max(lacks), 1e-8),
        ("v less the integral of a", np.abs(np.diff(v, axis=0) - dt * a[:-1]).max(), 1e-10),
        ("q less the integral of v", np.abs(moved).max(), 1e-10),
        ("feet missing on the ground", gait.least_contacts - contacts.sum(axis=1).min(), 0),
        ("wrenches of no contact", np.abs(wrenches[~contacts]).max(initial=0.0), 0),
        ("contacts that do not push", np.sum(np.array(loads) <= 0), 0),
        ("speed of a foot on the ground, m/s", max(speeds), 5e-3),
        ("its turning, rad/s", max(turns, default=0.0), 5e-3),
        ("its height, m", np.abs(heights).max(), 2e-3),
        ("angle past the limits of a joint", max(excess, 0.0), 1e-3),
        ("speed at the beginning", np.abs(v[0]).max(), 1e-12),
        ("speed at the end", np.abs(v[-1]).max(), 1e-2),
        *((f"use of the cone: {key}", max(values), 0.9) for key, values in cone.items()),
    ]
    for what, value, limit in results:
        verdict = "" if value <= limit else "  FAILED"
        print(f"  {what:36} {value:9.2e}   (at most {limit:.0e}){verdict}")
    least = min(loads) / (mass * np.linalg.norm(gravity))
    landings = int(np.sum(~contacts[:-1] & contacts[1:]))
    print(f"  {len(t)} rows, {landings} landings, least load of a foot {least:.3f} m g")
    return all(value <= limit for _, value, limit in results)


def describe(gait: Gait, robots: Path) -> dict[str, Any]:
    """Tell where a motion comes from."""
    robot = gait.robot
    return {
        "generator": "examples/make_walks.py",
        "versions": {"crocoddyl": crocoddyl.__version__, "pinocchio": pinocchio.__version__},
        "robots": "example-robot-data",
        "urdf": robot.urdf,
        "urdf_sha256": hashlib.sha256((robots / robot.urdf).read_bytes()).hexdigest(),
        "gait": {key: value for key, value in asdict(gait).items() if key != "robot"},
        "reference": robot.reference,
        "frame_height": robot.frame_height,
        "wrenches": "force, then moment, in the contact's frame and about its origin",
        "impulses": "none: each landing is an ordinary knot that asks the foot to be at rest, so "
        "that no knot was dropped and the time line is uniform",
        "integration": "v[k+1] = v[k] + a[k] dt, q[k+1] = q[k] + v[k+1] dt",
    }


def find_robots() -> Path | None:
    """Find the robots of ``example-robot-data`` among the installed packages."""
    for folder in sys.path:
        robots = Path(folder) / "cmeel.prefix/share/example-robot-data/robots"
        if robots.is_dir():
            return robots
    return None


def main() -> int:
    """Plan the motions, check them, and write those that pass."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("gaits", nargs="*", metavar="GAIT", help=f"of {', '.join(GAITS)}: all")
    parser.add_argument("--robots", type=Path, default=find_robots(), help="folder of the URDFs")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "data")
    args = parser.parse_args()
    if args.robots is None:
        parser.error("example-robot-data is not installed: give --robots")
    if unknown := set(args.gaits) - set(GAITS):
        parser.error(f"no such gait: {', '.join(sorted(unknown))}")
    passed = True
    for name in args.gaits or GAITS:
        gait = GAITS[name]
        model = load(gait.robot, args.robots)
        print(name, flush=True)
        rows = sample(gait, model, plan(gait, model))
        if not check(gait, model, rows):
            passed = False
            continue
        args.out.mkdir(parents=True, exist_ok=True)
        path = args.out / f"{name}.npz"
        np.savez_compressed(path, **rows, meta=np.array(json.dumps(describe(gait, args.robots))))
        print(f"  {path.name}: {path.stat().st_size / 1e3:.0f} kB")
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: BSD-2-Clause
import gc
import threading

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import ContactSchedule, DistributionStatus, DynaCoM, Motion, NotReadyError
from helpers import array_kinds, point, random_configuration, random_humanoid, share_by_edges, sole

SOLVED, NO_CONTACT = DistributionStatus.Solved, DistributionStatus.NoContact
FRAMES = 12
NAMES = ["right", "left", "hand"]


@pytest.fixture(scope="module")
def model() -> pin.Model:
    return random_humanoid(0)


@pytest.fixture
def robot(model: pin.Model) -> DynaCoM:
    """Soles and a point, in a posture of its own; `idle` is in nobody's schedule."""
    robot = DynaCoM(model)
    fields = {"mu": 5.0, "gu": 4.0, "half_length": 1.0, "half_width": 1.0}
    robot.addContact(sole(frame_name="rleg6_joint", **fields), "right")
    robot.addContact(sole(frame_name="lleg6_joint", **fields), "left", False)
    robot.addContact(point(frame_name="rarm5_joint", mu=0.5, radius=0.1), "hand")
    robot.addContact(sole(frame_name="larm5_joint", **fields), "idle")
    zero = np.zeros(model.nv)
    robot.computeDynamics(random_configuration(model, 99), zero, zero, flatHorizontalGround=False)
    return robot


@pytest.fixture
def arrays(model: pin.Model) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    q = np.array([random_configuration(model, seed) for seed in range(FRAMES)])
    # Above the ground, which gives the pendulum a frequency.
    q[:, 2] += 5.0
    v, a = rng.uniform(-1.0, 1.0, (2, FRAMES, model.nv))
    return {"time": np.linspace(0.0, 1.1, FRAMES), "q": q, "v": v, "a": a}


@pytest.fixture
def active() -> np.ndarray:
    """Both soles; one; a sole and a point; none."""
    active = np.zeros((FRAMES, 3), dtype=bool)
    active[:6, :2] = True
    active[6:8, 1] = True
    active[8:10, [0, 2]] = True
    return active


@pytest.fixture
def motion(arrays) -> Motion:
    return Motion(**arrays)


@pytest.fixture
def schedule(active) -> ContactSchedule:
    return ContactSchedule(NAMES, active)


def state(robot: DynaCoM) -> list:
    values = [robot.getActiveContacts(), robot.getKnownContacts(), robot.getCoM().tolist()]
    values += [robot.getDistributionStatus(), robot.getGroundHeight(), robot.ne_b().tolist()]
    values += [[placement.homogeneous.tolist() for placement in robot.getData().oMi]]
    for name in robot.getKnownContacts():
        contact = robot.getContact(name)
        values += [contact.appliedForce().tolist(), contact.ne_A().tolist()]
        values += [contact.getPose().homogeneous.tolist(), contact.getFrameID()]
    return values


ARRAYS = ("com", "vcom", "acom", "am", "dam", "ground_force", "ground_torque")
ALL_ARRAYS = ("time", *ARRAYS, "cop", "vrp", "nl", "residual")
CONTACT_ARRAYS = ("active", "wrench", "vertical_force")


def assert_same(actual: dynacom.MotionAnalysis, expected: dynacom.MotionAnalysis) -> None:
    assert_array_equal(actual.omega, expected.omega)
    assert actual.status == expected.status
    for name in ALL_ARRAYS:
        assert_array_equal(getattr(actual, name), getattr(expected, name), name)
    for contact, other in zip(actual.contacts, expected.contacts, strict=True):
        assert contact.name == other.name
        for name in CONTACT_ARRAYS:
            assert_array_equal(getattr(contact, name), getattr(other, name), name)


# The analysis.


def test_what_bears_load_less_readily(robot, model, motion, active):
    """Weights are divided by √ρ, in lanes and without; forces are those of another solver."""
    rng = np.random.default_rng(1)
    readiness = rng.uniform(0.05, 1.0, active.shape)
    schedule = ContactSchedule(NAMES, active, readiness=readiness)
    robot.setGroundHeight(0.0)
    analyses = [dynacom.analyzeMotion(robot, motion, schedule, lanes=lanes) for lanes in (1, 8)]
    plain = dynacom.analyzeMotion(robot, motion, ContactSchedule(NAMES, active))
    for one, other, without in zip(
        analyses[0].contacts, analyses[1].contacts, plain.contacts, strict=True
    ):
        scale = np.abs(one.wrench).max(initial=1.0)
        assert_allclose(one.wrench, other.wrench, rtol=0, atol=1e-10 * scale)
        if one.name == "right":
            assert np.abs(one.wrench - without.wrench).max() > 0.01 * scale
    forces = {contact.name: contact.wrench for contact in analyses[0].contacts}

    own = robot.copy()
    compared = 0
    for frame in range(FRAMES):
        names = [name for name, on in zip(NAMES, active[frame], strict=True) if on]
        if analyses[0].status[frame] != SOLVED or not names:
            continue
        own.computeDynamics(motion.q[frame], motion.v[frame], motion.a[frame])
        contacts = []
        for name in names:
            contact = own.getContact(name)
            settings = contact.getSettings()
            ready = readiness[frame, NAMES.index(name)]
            settings.weights = settings.weights / np.sqrt(ready)
            contacts.append(type(contact)(settings))
            contacts[-1].updateNewtonEuler(own.getCoM(), contact.getPose())
        wrench = np.concatenate([own.getGroundCoMForce(), own.getGroundCoMTorque()])
        expected = share_by_edges(contacts, wrench).forces
        found = np.concatenate(
            [
                forces[name][frame, : contact.cols()]
                for name, contact in zip(names, contacts, strict=True)
            ]
        )
        assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())
        compared += 1
    assert compared >= 3


@pytest.mark.parametrize("flat", [True, False])
def test_every_frame_as_by_hand(robot, arrays, motion, active, schedule, flat):
    """The same as a loop over frames with one's own DynaCoM."""
    robot.setGroundHeight(-0.5)
    robot.setWarmStart(False)  # so that the same problem again takes the same steps
    analysis = dynacom.analyzeMotion(robot, motion, schedule, flat, 2.0, lanes=1)
    own = robot.copy()
    for name in own.getKnownContacts():
        own.deactivateContact(name)
    getters = (
        own.getCoM,
        own.getVCoM,
        own.getACoM,
        own.getAM,
        own.getAMVariation,
        own.getGroundCoMForce,
        own.getGroundCoMTorque,
    )
    contacts = {contact.name: contact for contact in analysis.contacts}
    scale = np.abs(analysis.ground_torque).max()
    statuses = set()
    for frame in range(FRAMES):
        for name, is_active in zip(NAMES, active[frame], strict=True):
            (own.activateContact if is_active else own.deactivateContact)(name)
        q, v, a = (arrays[key][frame] for key in "qva")
        own.computeNL(2.0, q, v, a, flatHorizontalGround=flat)
        for name, getter in zip(ARRAYS, getters, strict=True):
            assert_array_equal(getattr(analysis, name)[frame], getter(), name)
        assert_allclose(analysis.cop[frame], own.getCoP(), rtol=1e-12, atol=1e-12)
        assert_allclose(analysis.vrp[frame], own.getVRP(), rtol=1e-14, atol=1e-14)
        assert_allclose(analysis.nl[frame], own.getNL(), rtol=1e-12, atol=1e-12)
        status = own.distributeForce(
            own.getGroundCoMForce(), own.getGroundCoMTorque(), own.getCoM()
        )
        assert analysis.status[frame] == status
        statuses.add(str(status))
        given = np.zeros(6)
        for name in own.getKnownContacts():
            contact = own.getContact(name)
            wrench = np.zeros(6)
            wrench[: contact.cols()] = contact.appliedForce()
            assert_allclose(contacts[name].wrench[frame], wrench, rtol=0, atol=1e-12 * scale)
            vertical = contact.toWorldForces()[2]
            assert_allclose(contacts[name].vertical_force[frame], vertical, rtol=0, atol=1e-11)
            given += contact.toCoMForces()
        assert_allclose(analysis.residual[frame], own.ne_b() - given, rtol=0, atol=1e-12 * scale)
        if status == SOLVED:
            assert_allclose(analysis.residual[frame], 0.0, rtol=0, atol=1e-11 * scale)
        elif status == NO_CONTACT:
            assert_array_equal(analysis.residual[frame], own.ne_b())
        else:
            residual = own.getDistribution().residual
            assert_allclose(analysis.residual[frame], residual, rtol=0, atol=1e-12 * scale)
            assert np.linalg.norm(residual) > 1e-6 * scale
            assert given.any()
    assert statuses == {"Solved", "Relaxed", "NoContact"}


def test_shapes_and_types(robot, motion, schedule):
    analysis = dynacom.analyzeMotion(robot, motion, schedule)
    shapes = dict.fromkeys(ARRAYS, (FRAMES, 3)) | dict.fromkeys(("cop", "vrp", "nl"), (FRAMES, 2))
    shapes |= {"time": (FRAMES,), "residual": (FRAMES, 6)}
    for name, shape in shapes.items():
        assert getattr(analysis, name).shape == shape, name
    assert isinstance(analysis.omega, float)
    assert isinstance(analysis.status, list)
    assert len(analysis.status) == FRAMES
    assert all(isinstance(status, DistributionStatus) for status in analysis.status)
    for contact in analysis.contacts:
        assert isinstance(contact, dynacom.MotionAnalysis.Contact)
        assert contact.active.shape == (FRAMES,)
        assert contact.active.dtype == bool
        assert contact.wrench.shape == (FRAMES, 6)
        assert contact.vertical_force.shape == (FRAMES,)


def test_contacts_in_the_robot_s_order(robot, motion, active, schedule):
    """All that the robot knows; those without schedule are never active, even if they are now."""
    analysis = dynacom.analyzeMotion(robot, motion, schedule)
    assert [contact.name for contact in analysis.contacts] == robot.getKnownContacts()
    for contact in analysis.contacts:
        if contact.name == "idle":
            assert not contact.active.any()
        else:
            assert_array_equal(contact.active, active[:, NAMES.index(contact.name)])
        assert not contact.wrench[~contact.active].any()
        assert not contact.vertical_force[~contact.active].any()
        if contact.name == "hand":
            assert not contact.wrench[:, 3:].any()


def test_order_of_the_schedule_does_not_matter(robot, motion, active, schedule):
    expected = dynacom.analyzeMotion(robot, motion, schedule)
    shuffled = ContactSchedule(NAMES[::-1], active[:, ::-1])
    analysis = dynacom.analyzeMotion(robot, motion, shuffled)
    assert analysis.status == expected.status
    scale = np.abs(expected.ground_torque).max()
    for contact, other in zip(analysis.contacts, expected.contacts, strict=True):
        assert contact.name == other.name
        assert_allclose(contact.wrench, other.wrench, rtol=0, atol=1e-9 * scale)


def test_the_robot_is_left_as_it_is(robot, arrays, motion, schedule):
    robot.computeDynamics(*(arrays[key][3] for key in "qva"))
    robot.distributeForce(robot.getGroundCoMForce(), robot.getGroundCoMTorque(), robot.getCoM())
    before = state(robot)
    dynacom.analyzeMotion(robot, motion, schedule)
    assert state(robot) == before


def test_the_result_stands_alone(model, robot, arrays, motion, schedule):
    """It keeps nothing of what it was made from, and hands out copies."""
    analysis = dynacom.analyzeMotion(robot, motion, schedule)
    expected = dynacom.analyzeMotion(robot, motion, schedule)
    robot.initialize(model)
    for values in arrays.values():
        values[:] = np.nan
    del robot, motion, schedule
    gc.collect()
    for name in ALL_ARRAYS:
        getattr(analysis, name)[:] = 99.0
    analysis.status.clear()
    for contact in analysis.contacts:
        for name in CONTACT_ARRAYS:
            getattr(contact, name)[:] = 1
    analysis.contacts.clear()
    assert_same(analysis, expected)
    (contact, *_) = analysis.contacts
    wrench = contact.wrench
    del analysis
    gc.collect()
    assert_array_equal(contact.wrench, wrench)


def test_keywords_and_defaults(robot, motion, schedule):
    expected = dynacom.analyzeMotion(robot, motion, schedule)
    assert_same(
        dynacom.analyzeMotion(
            robot=robot,
            motion=motion,
            schedule=schedule,
            flatHorizontalGround=True,
            omega=0.0,
            progress=None,
        ),
        expected,
    )
    assert_same(dynacom.analyzeMotion(robot, motion, schedule, True, 0, None), expected)


# The pendulum's frequency.


def test_omega_of_the_mean_height(robot, motion, schedule):
    """sqrt(g / h), with h the height of the centre of mass above the ground."""
    analysis = dynacom.analyzeMotion(robot, motion, schedule)
    assert_allclose(analysis.omega, np.sqrt(9.81 / analysis.com[:, 2].mean()), rtol=1e-14)
    robot.setGroundHeight(-2.0)
    analysis = dynacom.analyzeMotion(robot, motion, schedule)
    height = analysis.com[:, 2].mean() + 2.0
    assert_allclose(analysis.omega, np.sqrt(9.81 / height), rtol=1e-14)
    vrp = analysis.com[:, :2] - analysis.acom[:, :2] * height / 9.81
    assert_allclose(analysis.vrp, vrp, rtol=0, atol=1e-12)
    assert_allclose(analysis.nl, analysis.cop - vrp, rtol=0, atol=1e-11)


def test_omega_given(robot, motion, schedule):
    analysis = dynacom.analyzeMotion(robot, motion, schedule, omega=3)
    assert analysis.omega == 3.0
    assert_allclose(analysis.vrp, analysis.com[:, :2] - analysis.acom[:, :2] / 9.0, atol=1e-13)


def test_no_omega(robot, model, motion, schedule):
    """Below the ground or without gravity there is no pendulum; all the rest is there."""
    robot.setGroundHeight(100.0)
    floating = pin.Model(model)
    floating.gravity.linear = np.zeros(3)
    weightless = DynaCoM(floating)
    nothing = ContactSchedule([], np.zeros((FRAMES, 0), dtype=bool))
    for analysis in (
        dynacom.analyzeMotion(robot, motion, schedule),
        dynacom.analyzeMotion(weightless, motion, nothing),
    ):
        assert np.isnan(analysis.omega)
        assert np.isnan(analysis.vrp).all()
        assert np.isnan(analysis.nl).all()
        assert np.isfinite(analysis.ground_force).all()
    assert dynacom.analyzeMotion(weightless, motion, nothing, omega=2.0).omega == 2.0


@pytest.mark.parametrize("omega", [-1.0, np.nan, -np.inf])
def test_omega_out_of_range(robot, motion, schedule, omega):
    with pytest.raises(ValueError, match=f"omega must be finite and >= 0 rad/s, got {omega:g}"):
        dynacom.analyzeMotion(robot, motion, schedule, omega=omega)


# Progress, threads.


def long_motion(arrays: dict[str, np.ndarray], frames: int) -> Motion:
    repeated = {key: np.resize(arrays[key], (frames, arrays[key].shape[1])) for key in "qva"}
    return Motion(time=np.arange(frames), **repeated)


def test_progress(robot, arrays):
    """Called now and then, with more frames every time, and at last with all of them."""
    motion = long_motion(arrays, 1000)
    schedule = ContactSchedule(["left"], np.ones((1000, 1), dtype=bool))
    seen = []
    # A thread that is alone has nobody who is faster.
    analysis = dynacom.analyzeMotion(robot, motion, schedule, progress=seen.append, threads=1)
    assert len(seen) >= 3
    assert seen == sorted(set(seen))
    assert seen[-1] == 1000
    assert all(type(frames) is int for frames in seen)
    assert_same(analysis, dynacom.analyzeMotion(robot, motion, schedule))


def test_progress_that_raises(robot, motion, schedule):
    """The caller's own exception comes back as it is; nothing is the worse for it."""

    class Stop(Exception):
        pass

    def stop(frames):
        raise Stop(f"after {frames}")

    before = state(robot)
    with pytest.raises(Stop, match="after 12"):
        dynacom.analyzeMotion(robot, motion, schedule, progress=stop)
    with pytest.raises(TypeError, match="not callable"):
        dynacom.analyzeMotion(robot, motion, schedule, progress=3)
    assert state(robot) == before
    assert len(dynacom.analyzeMotion(robot, motion, schedule).status) == FRAMES


def test_analyses_in_threads(robot, arrays, active):
    """Of one robot at the same time: it is not touched, so none disturbs another."""
    motion = long_motion(arrays, 300)
    schedule = ContactSchedule(NAMES, np.resize(active, (300, 3)))
    expected = dynacom.analyzeMotion(robot, motion, schedule)
    results = {}

    def run(number):
        seen = []
        results[number] = dynacom.analyzeMotion(robot, motion, schedule, progress=seen.append)
        assert seen[-1] == 300

    threads = [threading.Thread(target=run, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for number in range(4):
        assert_same(results[number], expected)


def test_python_goes_on_meanwhile(robot, arrays):
    """The analysis does not hold Python's lock: another thread counts on."""
    motion = long_motion(arrays, 20000)
    schedule = ContactSchedule(["left"], np.ones((20000, 1), dtype=bool))
    counts, done = [], threading.Event()

    def count():
        ticks = 0
        while not done.wait(1e-4):
            ticks += 1
            counts.append(ticks)

    thread = threading.Thread(target=count)
    thread.start()
    before = len(counts)
    # The counter would not advance between two calls if they came with the lock held all along.
    dynacom.analyzeMotion(robot, motion, schedule)
    after = len(counts)
    done.set()
    thread.join()
    assert after > before + 1


# Motions and schedules.


def test_motion_as_given(arrays, motion):
    assert motion.frames == FRAMES
    for name, values in arrays.items():
        assert_array_equal(getattr(motion, name), values)
        assert getattr(motion, name).dtype == float
    for values in arrays.values():
        values[:] = 99.0
    for name in arrays:
        assert (getattr(motion, name) != 99.0).any()
        getattr(motion, name)[:] = 99.0
        assert (getattr(motion, name) != 99.0).any()


def test_matrices_of_any_kind(model):
    rng = np.random.default_rng(0)
    q = rng.integers(-5, 6, (FRAMES, model.nq)).astype(float)
    v = rng.integers(-5, 6, (FRAMES, model.nv)).astype(float)
    kinds = {
        "plain": lambda x: x,
        "integers": lambda x: x.astype(int),
        "float32": lambda x: x.astype(np.float32),
        "Fortran": np.asfortranarray,
        "strided": lambda x: np.repeat(np.repeat(x, 2, axis=0), 3, axis=1)[::2, ::3],
        "reversed": lambda x: x[::-1, ::-1].copy()[::-1, ::-1],
        "transposed": lambda x: x.T.copy().T,
        "columns of a larger one": lambda x: np.hstack([x, x, x])[:, x.shape[1] : 2 * x.shape[1]],
        "strided integers": lambda x: np.repeat(x.astype(int), 2, axis=0)[::2],
    }
    for kind, change in kinds.items():
        motion = Motion(np.arange(FRAMES), change(q), change(v), change(-v))
        assert_array_equal(motion.time, np.arange(FRAMES), kind)
        assert_array_equal(motion.q, q, kind)
        assert_array_equal(motion.v, v, kind)
        assert_array_equal(motion.a, -v, kind)
    for kind, time in array_kinds(np.arange(FRAMES)):
        assert_array_equal(Motion(time, q, v, v).time, np.arange(FRAMES), kind)


def test_schedules_of_any_kind(active):
    for kind, values in {
        "plain": active,
        "Fortran": np.asfortranarray(active),
        "strided": np.repeat(np.repeat(active, 2, axis=0), 2, axis=1)[::2, ::2],
        "reversed": active[::-1].copy()[::-1],
        "transposed": active.T.copy().T,
    }.items():
        schedule = ContactSchedule(NAMES, values)
        assert schedule.names == NAMES
        assert schedule.active.dtype == bool
        assert_array_equal(schedule.active, active, kind)
    names, values = list(NAMES), active.copy()
    schedule = ContactSchedule(names=names, active=values)
    names.clear()
    values[:] = ~values
    schedule.names.clear()
    schedule.active[:] = ~active
    assert schedule.names == NAMES
    assert_array_equal(schedule.active, active)


def test_a_single_frame(robot, model, arrays, active):
    """Arrays keep their dimensions: one row is still a row."""
    motion = Motion(**{name: values[:1] for name, values in arrays.items()})
    schedule = ContactSchedule(NAMES, active[:1])
    assert motion.frames == 1
    motion.validate(model)
    analysis = dynacom.analyzeMotion(robot, motion, schedule)
    assert analysis.status == [SOLVED]
    assert motion.q.shape == (1, model.nq)
    assert motion.a.shape == (1, model.nv)
    assert schedule.active.shape == (1, 3)
    assert analysis.com.shape == (1, 3)
    assert analysis.cop.shape == (1, 2)
    assert analysis.residual.shape == (1, 6)
    assert analysis.contacts[0].wrench.shape == (1, 6)
    assert analysis.contacts[0].active.shape == (1,)


def test_a_single_contact(active):
    """As above, for columns."""
    schedule = ContactSchedule(["left"], active[:, 1:2])
    schedule.validate(FRAMES)
    assert schedule.active.shape == (FRAMES, 1)


def test_no_contact_at_all(model, motion):
    nothing = ContactSchedule([], np.zeros((FRAMES, 0), dtype=bool))
    nothing.validate(frames=FRAMES)
    for flat in (True, False):
        analysis = dynacom.analyzeMotion(DynaCoM(model), motion, nothing, flat)
        assert analysis.status == [DistributionStatus.NoContact] * FRAMES
        assert analysis.contacts == []
        wrench = np.hstack([analysis.ground_force, analysis.ground_torque])
        assert_array_equal(analysis.residual, wrench)
        assert np.isnan(analysis.cop).all() != flat


def broken(values: np.ndarray, frame: int, value: float) -> np.ndarray:
    values = values.copy()
    values[frame] = value
    return values


MOTIONS = {
    "no frames": ("time", lambda time: time[:0], "time must have at least one frame, got 0"),
    "time stands": ("time", lambda t: broken(t, 4, t[3]), "time must increase, got .* frame 4"),
    "time goes back": (
        "time",
        lambda t: broken(t, 4, -1),
        "time must increase, got .*-1 s in .* 4",
    ),
    "time not finite": ("time", lambda t: broken(t, 4, np.inf), "time must be finite, got inf in"),
    "too few times": ("time", lambda t: t[:-1], "q must have 11 frames, got 12"),
    "q short": ("q", lambda q: q[:-1], "q must have 12 frames, got 11"),
    "v short": ("v", lambda v: v[1:], "v must have 12 frames, got 11"),
    "a long": ("a", lambda a: np.vstack([a, a]), "a must have 12 frames, got 24"),
    "q narrow": ("q", lambda q: q[:, :-1], r"q must have 33 components \(nq\), got 32"),
    "v like q": ("v", lambda v: v[:, [0, *range(32)]], r"v must have 32 components \(nv\), got 33"),
    "a narrow": ("a", lambda a: a[:, 3:], r"a must have 32 components \(nv\), got 29"),
    "q not finite": ("q", lambda q: broken(q, 5, np.nan), "q must be finite, got .* frame 5"),
    "v not finite": ("v", lambda v: broken(v, 0, np.inf), "v must be finite, got .* frame 0"),
    "a not finite": ("a", lambda a: broken(a, 11, -np.inf), "a must be finite, got .* frame 11"),
}


@pytest.mark.parametrize(("name", "change", "message"), MOTIONS.values(), ids=MOTIONS.keys())
def test_motions_that_are_not_valid(robot, model, arrays, schedule, name, change, message):
    """The first array that is wrong is named, and the frame, what was expected and what was got."""
    Motion(**arrays).validate(model)
    arrays[name] = change(arrays[name])
    motion = Motion(**arrays)
    before = state(robot)
    with pytest.raises(ValueError, match=f"^{message}"):
        motion.validate(model=model)
    with pytest.raises(ValueError, match=f"^{message}"):
        dynacom.analyzeMotion(robot, motion, schedule)
    assert state(robot) == before


def test_schedules_that_are_not_valid(robot, motion, active):
    ContactSchedule(NAMES, active).validate(FRAMES)
    for names, values, message in (
        (["left", "right", "left"], active, "the contact 'left' twice"),
        (["left", "right"], active, "active must have 2 contacts, got 3"),
        (NAMES, active[:-1], f"active must have {FRAMES} frames, got {FRAMES - 1}"),
        ([], active, "active must have 0 contacts, got 3"),
    ):
        schedule = ContactSchedule(names, values)
        with pytest.raises(ValueError, match=message):
            schedule.validate(FRAMES)
        with pytest.raises(ValueError, match=message):
            dynacom.analyzeMotion(robot, motion, schedule)
    unknown = ContactSchedule(["left", "tail"], active[:, :2])
    unknown.validate(FRAMES)
    with pytest.raises(ValueError, match="'tail'; known: 'right', 'hand', 'idle', 'left'"):
        dynacom.analyzeMotion(robot, motion, unknown)


def test_wrong_types(robot, model, arrays, motion, active, schedule):
    for name in arrays:
        for wrong in (None, "q", 3.0, np.ones((2, 2, 2)), np.array([["a"]]), [[1.0]]):
            with pytest.raises(TypeError):
                Motion(**arrays | {name: wrong})
    for wrong in (None, "left", 3, (1, 2, 3), [1, 2, 3], [None] * 3):
        with pytest.raises(TypeError):
            ContactSchedule(wrong, active)
    for wrong in (None, "left", [[True]], active.astype(float), np.array([["a"]])):
        with pytest.raises(TypeError):
            ContactSchedule(NAMES, wrong)
    for call in (
        lambda: dynacom.analyzeMotion(model, motion, schedule),
        lambda: dynacom.analyzeMotion(robot, arrays, schedule),
        lambda: dynacom.analyzeMotion(robot, motion, active),
        lambda: dynacom.analyzeMotion(robot, motion, None),
        lambda: dynacom.analyzeMotion(robot, motion, schedule, omega="3"),
        lambda: dynacom.analyzeMotion(robot, motion, schedule, omega=None),
        lambda: motion.validate(robot),
        lambda: schedule.validate("12"),
    ):
        with pytest.raises(TypeError):
            call()


def test_robot_before_initialize(motion):
    nothing = ContactSchedule([], np.zeros((FRAMES, 0), dtype=bool))
    with pytest.raises(NotReadyError, match=r"DynaCoM .* before initialize\(\)"):
        dynacom.analyzeMotion(DynaCoM(), motion, nothing)


def test_quaternions_that_are_none(model, arrays):
    for factor in (0.0, 1.1):
        q = arrays["q"].copy()
        q[2, 3:7] *= factor
        with pytest.raises(ValueError, match="q must have quaternions of norm 1, .* in frame 2"):
            Motion(**arrays | {"q": q}).validate(model)

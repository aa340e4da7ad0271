"""Made-up clips of Unitree's G1 as datasets have them: CSV without a header, 6 decimals.

The robot crouches, sways and swings its arms, each with an amplitude and a frequency of its own.
In some clips it lifts a foot again and again, in some it hops; some are too fast to be feasible.
"""

import numpy as np

import dynacom

FPS, SECONDS = 30, 10
FRAMES = FPS * SECONDS
# How many lift a foot, and how many hop.
STEPPING, HOPPING = 0.6, 0.15
GRAVITY = 9.81


def swing(time, random, amplitude, frequencies):
    """A sine of an amplitude up to this one, and of one of these frequencies [Hz]."""
    angle = 2 * np.pi * (random.uniform(*frequencies) * time + random.uniform())
    return random.uniform(0, amplitude) * np.sin(angle)


def rotate(quaternions, vectors):
    """Vectors (T, 3), each turned by its quaternion (T, 4), x y z w."""
    axes, w = quaternions[:, :3], quaternions[:, 3:]
    return vectors + 2 * np.cross(axes, np.cross(axes, vectors) + w * vectors)


def multiply(left, right):
    """The quaternion left, x y z w, times each of right, (T, 4)."""
    axis, axes = left[:3], right[:, :3]
    w = left[3] * right[:, 3:] - axes @ axis[:, None]
    return np.hstack([left[3] * axes + right[:, 3:] * axis + np.cross(axis, axes), w])


def joint_angles(time, random):
    """{joint: (T,)}, and how high the robot hops, (T,)."""
    # A crouch down to `deep` and up again; the steps are of the same beat.
    beat, deep = random.uniform(0.1, 1.2), random.uniform(0.0, 0.5)
    phase = 2 * np.pi * beat * time
    bend = random.uniform(0.1, 0.5) + deep * (1 - np.cos(phase)) / 2
    lift, hop = np.zeros_like(time), np.zeros_like(time)
    roll = swing(time, random, 0.06, (0.1, 0.8))
    yaw = swing(time, random, 0.03, (0.1, 0.5))
    kind = random.uniform()
    if kind < STEPPING:
        step = np.sin(phase / 2).clip(0)
        lift = random.uniform(0.15, 0.5) * step**2
        roll = random.uniform(0.05, 0.2) * np.sqrt(step)
    elif kind < STEPPING + HOPPING:
        # In the air for `flight` of every period, and along a parabola there.
        flight, period = random.uniform(0.15, 0.4), random.uniform(1.0, 3.0)
        since = time % period
        hop = np.where(since < flight, 0.5 * GRAVITY * since * (flight - since), 0.0)

    angles = {}
    for side, sign, knee in (("left", 1, bend), ("right", -1, bend + lift)):
        angles |= {
            f"{side}_hip_pitch_joint": -knee,
            f"{side}_knee_joint": 2 * knee,
            f"{side}_ankle_pitch_joint": -knee,
            f"{side}_hip_roll_joint": roll,
            f"{side}_ankle_roll_joint": -roll,
            f"{side}_hip_yaw_joint": yaw,
            f"{side}_shoulder_pitch_joint": swing(time, random, 0.8, (0.1, 1.5)),
            f"{side}_shoulder_roll_joint": sign * (0.3 + swing(time, random, 0.3, (0.1, 1.0))),
            f"{side}_shoulder_yaw_joint": swing(time, random, 0.3, (0.1, 1.0)),
            f"{side}_elbow_joint": 0.8 + swing(time, random, 0.6, (0.1, 1.5)),
            f"{side}_wrist_roll_joint": swing(time, random, 0.3, (0.1, 1.0)),
            f"{side}_wrist_pitch_joint": swing(time, random, 0.3, (0.1, 1.0)),
            f"{side}_wrist_yaw_joint": swing(time, random, 0.3, (0.1, 1.0)),
        }
    for axis, amplitude in (("yaw", 0.4), ("roll", 0.1), ("pitch", 0.25)):
        angles[f"waist_{axis}_joint"] = swing(time, random, amplitude, (0.1, 1.2))
    return angles, hop


def make_clip(robot, random):
    """What a file holds, (T, 36): the root's position and quaternion, x y z w, and the joints."""
    time = np.arange(FRAMES) / FPS
    angles, hop = joint_angles(time, random)
    q = np.zeros((FRAMES, robot.model.nq))
    q[:, 6] = 1.0
    for column, name in enumerate(robot.joints.names, 7):
        q[:, column] = angles.pop(name)
    assert not angles

    # The root goes where the left sole lies flat on the ground, in a place of the clip's own.
    rest = np.zeros((FRAMES, robot.model.nv))
    moved = dynacom.computeContactMotions(robot.dynacom(), dynacom.Motion(time, q, rest, rest))
    left_sole = moved[0]
    yaw = random.uniform(-np.pi, np.pi)
    heading = np.array([0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)])
    q[:, 3:7] = multiply(heading, left_sole.rotation * [-1, -1, -1, 1])
    q[:, :3] = [*random.uniform(-1, 1, 2), 0.0] - rotate(q[:, 3:7], left_sole.position)
    q[:, 2] += hop
    return q


def write_clips(folder, number):
    """So many clips: their files, the same ones each time."""
    robot = dynacom.load_robot("g1")
    random = np.random.default_rng(20)
    row = ",".join(["%.6f"] * robot.model.nq) + "\n"
    files = []
    for index in range(number):
        q = make_clip(robot, random)
        files.append(folder / f"clip_{index:04}.csv")
        files[-1].write_text((row * FRAMES) % tuple(q.ravel()))
    return files

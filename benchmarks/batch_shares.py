"""Where the time of a batch goes: all that is done with a clip, in one process, step by step.

It calls what workers call. Times are those of the processor: what else the machine does, and
waiting for the disk, is not in them.
"""

import hashlib
import tempfile
import time
from collections import Counter
from multiprocessing.connection import Pipe
from pathlib import Path

import clips
import numpy as np
import pyarrow.csv

import dynacom
from dynacom.batch_judge import Judge
from dynacom.batch_overview import overview
from dynacom.batch_page import write_index
from dynacom.batch_pool import Done, Task
from dynacom.batch_row import Job
from dynacom.batch_store import Store
from dynacom.motion_report import examine, make_examiner

# In the order in which they are done; these are those of MotionExaminer.examine.
EXAMINATION = (
    "filter and derivatives",
    "dynamics and contacts' motions",
    "inference of contacts",
    "distribution of forces",
    "verdict and statistics",
)
STEPS = ("hashing", "reading", *EXAMINATION, "the row", "to a worker and back", "Parquet and page")
# What a call takes for so few frames is no step's: it makes once what an examiner keeps.
FEW = 2


def count_lanes():
    return dynacom.countLanes(dynacom.load_robot("g1").dynacom())


def timed(call, *arguments, **others):
    """What it returns, and the processor time that it took [s]."""
    start = time.process_time()
    value = call(*arguments, **others)
    return value, time.process_time() - start


def least(repetitions, call, *arguments):
    """{name: seconds}, each the least of several."""
    runs = [call(*arguments) for _ in range(repetitions)]
    return {name: min(run[name] for run in runs) for name in runs[0]}


class Bench:
    """Does with clips what a batch does."""

    def __init__(self):
        self.job = Job(
            dynacom.load_robot("g1"), dynacom.AnalysisOptions(distance=False), fps=clips.FPS
        )
        self.judge = Judge(self.job)
        self.robot = self.job.robot.dynacom()
        self.parts = dynacom.splitContacts(self.robot)
        options = self.job.options
        self.examiner = make_examiner(self.job.robot, options, sensitivity=False, threads=1)
        self.ours, self.its = Pipe()

    def outline(self, file):
        """{step: seconds}, with MotionExaminer.examine as one."""
        task = Task(0, str(file), str(file), None)
        rows, judging = timed(self.judge, task.name, task.file, task.known)
        _, hashing = timed(lambda: hashlib.sha256(file.read_bytes()).hexdigest())
        clip, reading = timed(dynacom.read_motion, file, self.job.robot, fps=clips.FPS)
        job = self.job
        _, examining = timed(examine, clip, job.robot, job.options, self.examiner)
        _, passing = timed(self.passing, task, Done(0, rows))
        return {
            "judging": judging,
            "hashing": hashing,
            "reading": reading,
            "examining": examining,
            "to a worker and back": passing,
        }

    def passing(self, task, done):
        for sender, receiver, what in ((self.ours, self.its, task), (self.its, self.ours, done)):
            sender.send(what)
            receiver.recv()

    def examination(self, clip, frames):
        """{step: seconds} of the first frames: each step as a call of its own."""
        recorded = dynacom.RecordedMotion(clip.time[:frames], clip.q[:frames])
        robot, options, seconds = self.robot, self.job.options, Counter()
        model, cutoff = robot.getModel(), options.cutoff_number

        def step(name, call, *arguments, **others):
            value, taken = timed(call, *arguments, **others)
            seconds[name] += taken
            return value

        deriving, sweeping, inferring, distributing, judging = EXAMINATION
        derived = step(deriving, dynacom.deriveMotion, model, recorded, cutoff)
        motion, parts = derived.motion, self.parts
        contacts = dynacom.computeContactMotions(robot, motion, threads=1)
        corners = dynacom.computeContactMotions(parts.robot, motion, threads=1)
        how = {"flatHorizontalGround": options.flat, "omega": options.omega, "threads": 1}
        none = dynacom.ContactSchedule([], np.zeros((frames, 0), dtype=bool))
        needed = step(sweeping, dynacom.analyzeMotion, parts.robot, motion, none, **how)
        inference = step(
            inferring,
            dynacom.inferContacts,
            parts,
            corners,
            needed,
            derived.isExact(),
            options.detection,
        )
        schedule, ground = inference.schedule, inference.ground
        analysis = step(distributing, dynacom.analyzeMotion, parts.robot, motion, schedule, **how)
        seconds[distributing] -= seconds[sweeping]  # which it does once more
        found = motion, recorded, corners, ground, analysis, options.verdict
        verdict = step(judging, dynacom.judgeMotion, parts.robot, *found, threads=1)
        whole = step(judging, dynacom.gatherParts, robot, parts, contacts, corners, analysis)
        step(judging, dynacom.summarizeMotion, robot, motion, whole, verdict)
        return seconds

    def writing(self, files, times):
        """Seconds of the results of so many times these clips, for each."""
        judged = [self.judge(str(file), str(file), None)[0] for file in files]
        names = [f"{number}/{row['file']}" for number in range(times) for row in judged]
        rows = [row | {"file": name} for row, name in zip(judged * times, names, strict=True)]

        def write(folder):
            with Store.open(folder, self.job, names, False) as store:
                for index, row in enumerate(rows):
                    store.add(index, [row])
                store.finish()
                write_index(folder / "index.html", overview(store.table), {}, self.job)

        with tempfile.TemporaryDirectory() as folder:
            return timed(write, Path(folder))[1] / len(rows)


def readers(file, robot):
    """{reader: seconds} for one clip."""
    options = pyarrow.csv.ReadOptions(autogenerate_column_names=True)
    calls = {
        "`numpy.loadtxt`": lambda: np.loadtxt(file, delimiter=","),
        "`pyarrow.csv.read_csv`": lambda: pyarrow.csv.read_csv(file, options),
        "`dynacom.read_motion`": lambda: dynacom.read_motion(file, robot, fps=clips.FPS),
    }
    return {name: timed(call)[1] for name, call in calls.items()}


def measure(files, repetitions):
    """Means for these clips: of each step, and of readers; and what stand-alone steps count for."""
    bench = Bench()
    robot = bench.job.robot
    bench.outline(files[0])  # what is loaded on demand
    total, alone, reading = Counter(), Counter(), Counter()
    for file in files:
        total.update(least(repetitions, bench.outline, file))
        clip = dynacom.read_motion(file, robot, fps=clips.FPS)
        steps = least(repetitions, bench.examination, clip, clips.FRAMES)
        few = least(repetitions, bench.examination, clip, FEW)
        alone.update({name: steps[name] - few[name] for name in steps})
        reading.update(least(repetitions, readers, file, robot))
    seconds = {name: value / len(files) for name, value in total.items()}
    scale = total["examining"] / alone.total()
    seconds |= {name: scale * value / len(files) for name, value in alone.items()}
    judged = ("hashing", "reading", "examining")
    seconds["the row"] = seconds["judging"] - sum(seconds[name] for name in judged)
    seconds["Parquet and page"] = bench.writing(files, times=-(-1000 // len(files)))
    return {
        "shares": {name: seconds[name] for name in STEPS},
        "scale": scale,
        "readers": {name: value / len(files) for name, value in reading.items()},
    }

# SPDX-License-Identifier: BSD-2-Clause
"""Worker processes that judge clips, and that may die.

A clip whose worker dies is tried once more, in another, and then, if it is to be repaired, without
that; if all of them die, the clip has an error, and the others go on.
"""

import os
import signal
import subprocess
import sys
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, Pipe, wait
from typing import NamedTuple

from dynacom.batch_judge import Judge, error_row
from dynacom.batch_repair import WritingError
from dynacom.batch_row import Job, Row
from dynacom.errors import DynacomError

# A worker has one more clip than it works on, so that it need not wait for the next.
_AHEAD = 2
_TICK = 0.5  # [s]


class Task(NamedTuple):
    """A file to judge; the others are the arguments of :class:`Judge`."""

    index: int
    name: str
    file: str
    known: str | None
    place: str | None = None


class Done(NamedTuple):
    """A file that was judged."""

    index: int
    #: None where they are known already.
    rows: list[Row] | None


class Pool:
    """Worker processes. They start when there is something to do, and end with :meth:`close`.

    What they need for it they get with the first file.
    """

    def __init__(self, job: Job, jobs: int | None) -> None:
        """Of so many processes; by default of as many as there are cores."""
        self._job = job
        self._jobs = jobs or len(os.sched_getaffinity(0))
        self._workers: list[_Worker] = []

    def start(self, files: int) -> None:
        """Starts what so many files will need: processes take a while until they can do anything.

        Meanwhile the caller finds out what is to be done, for which it may read meshes.
        """
        while len(self._workers) < min(self._jobs, files):
            self._workers.append(_Worker.start())

    def run(self, tasks: Iterable[Task]) -> Iterator[Done | None]:
        """Judges files, in any order, a few at a time.

        Yields:
            What is done; and None now and then, when nothing is.

        Raises:
            DynacomError: workers cannot be started, or cannot write results.
        """
        tasks = iter(tasks)
        again: deque[Task] = deque()
        deaths: Counter[int] = Counter()
        while True:
            self._deal(again, tasks)
            busy = {worker.connection: worker for worker in self._workers if worker.given}
            if not busy:
                return
            ready = wait(list(busy), timeout=_TICK)
            if not ready:
                yield None
            for connection in ready:
                worker = busy[connection]
                try:
                    yield worker.receive()
                    continue
                except (EOFError, OSError):
                    self._workers.remove(worker)
                    how = worker.end()
                if not worker.has_started:
                    raise DynacomError(f"a worker process could not start ({how})")
                first, *others = worker.given
                again.extendleft(reversed(others))
                deaths[first.index] += 1
                if deaths[first.index] == 1:
                    again.appendleft(first)
                elif first.place is not None:
                    again.appendleft(first._replace(place=None))
                else:
                    times = {2: "twice", 3: "three times"}[deaths[first.index]]
                    message = f"{first.name}: its worker process died {times} ({how})"
                    yield Done(first.index, [error_row(self._job, first.name, message)])

    def close(self) -> None:
        """Ends the workers, whatever they do."""
        for worker in self._workers:
            worker.connection.close()
        while self._workers:
            self._workers.pop().end()

    def _deal(self, again: deque[Task], tasks: Iterator[Task]) -> None:
        """Gives workers something to do, as long as there is something."""
        for ahead in range(1, _AHEAD + 1):
            for number in range(self._jobs):
                if number < len(self._workers) and len(self._workers[number].given) >= ahead:
                    continue
                task = again.popleft() if again else next(tasks, None)
                if task is None:
                    return
                if number == len(self._workers):
                    self._workers.append(_Worker.start())
                self._workers[number].give(task, self._job)


@dataclass
class _Worker:
    process: subprocess.Popen
    connection: Connection
    #: In the order in which it does them.
    given: deque[Task] = field(default_factory=deque)
    has_job: bool = False
    has_started: bool = False

    @classmethod
    def start(cls) -> "_Worker":
        ours, its = Pipe()
        # Neither fork, which copies threads' locks, nor multiprocessing's spawn, which runs the
        # caller's script again.
        code = (
            f"import sys; sys.path[:] = {[*map(str, sys.path)]!r}; "
            f"from dynacom.batch_pool import work; work({its.fileno()})"
        )
        one = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
        process = subprocess.Popen(
            [sys.executable, "-c", code],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            env=one | os.environ,
            pass_fds=[its.fileno()],
            start_new_session=True,  # Ctrl-C is for us
        )
        its.close()
        return cls(process, ours)

    def give(self, task: Task, job: Job) -> None:
        self.given.append(task)
        with suppress(OSError):  # what has died is found out on receiving
            if not self.has_job:
                self.has_job = True
                self.connection.send(job)
            self.connection.send(task)

    def receive(self) -> Done | None:
        """The next reply.

        Raises:
            EOFError, OSError: the worker has died.
            WritingError: it cannot write results.
        """
        reply = self.connection.recv()
        if isinstance(reply, WritingError):
            raise reply
        self.has_started = True
        if reply is None:
            return None
        self.given.popleft()
        return reply

    def end(self) -> str:
        """Ends it, if it has not ended: how it did."""
        self.connection.close()
        died = self.process.poll()
        if died is None:
            try:
                # One that died is soon gone, another one has nothing to say any more.
                died = self.process.wait(0.2 if self.given else 2.0)
            except subprocess.TimeoutExpired:
                self.process.kill()
                died = self.process.wait()
        if died < 0:
            with suppress(ValueError):
                return f"by {signal.Signals(-died).name}"
        return f"exit status {died}"


def work(descriptor: int) -> None:
    """What a worker does, until nobody is at the other end of the pipe."""
    with suppress(EOFError, BrokenPipeError, ConnectionResetError), Connection(descriptor) as pipe:
        judge = Judge(pipe.recv())
        pipe.send(None)
        while True:
            task = pipe.recv()
            try:
                pipe.send(Done(task.index, judge(*task[1:])))
            except WritingError as error:
                pipe.send(error)
                return

# SPDX-License-Identifier: BSD-2-Clause
"""A batch on Ray Data: for people with a cluster."""

import logging
import os
import pickle
from collections.abc import Iterable, Iterator
from typing import Any

from dynacom.batch_pool import Done, Pool, Task
from dynacom.batch_row import Job
from dynacom.errors import DynacomError

# Files that an actor takes at a time, at most: what Ray does for a block takes as long as some
# clips.
_BLOCK = 64
# Blocks that each actor gets, at least, so that they end together, and those that die lose little.
_BLOCKS = 8
# Of an actor [cores]: there must be room for Ray's own tasks.
_CORES = 0.5


def import_ray() -> Any:
    """Ray, which tells nobody about it.

    Raises:
        DynacomError: it is not installed.
    """
    for name, value in (("RAY_USAGE_STATS_ENABLED", "0"), ("RAY_BACKEND_LOG_LEVEL", "fatal")):
        os.environ.setdefault(name, value)
    try:
        import ray
        import ray.data
    except ImportError as error:
        raise DynacomError("engine ray needs Ray: pip install dynacom[ray]") from error
    return ray


class RayPool:
    """Actors of Ray, on its cluster if it is connected to one, else on this machine.

    Each has a worker process, which holds the robot and may die of a clip as those of :class:`Pool`
    do. What dies with an actor or its machine, Ray does again elsewhere.
    """

    def __init__(self, job: Job, jobs: int | None) -> None:
        """Connects to Ray, as ``RAY_ADDRESS`` says, or starts it.

        Args:
            jobs: actors, at most; by default as many as there are cores.

        Raises:
            DynacomError: Ray is not installed.
        """
        ray = import_ray()
        self._job = job
        self._data = ray.data
        self._shut_down = None
        if not ray.is_initialized():
            ray.init(include_dashboard=False, log_to_driver=False, logging_level=logging.ERROR)
            self._shut_down = ray.shutdown
        logging.getLogger("ray.data").setLevel(logging.ERROR)
        self._jobs = jobs or max(1, int(ray.cluster_resources().get("CPU", 1)))

    def run(self, tasks: Iterable[Task]) -> Iterator[Done | None]:
        """Judges files, in any order, as :meth:`Pool.run`.

        Raises:
            DynacomError: workers cannot be started, or cannot write results.
        """
        items = [{"task": pickle.dumps(tuple(task))} for task in tasks]
        if not items:
            return
        context = self._data.DataContext.get_current()
        bars, context.enable_progress_bars = context.enable_progress_bars, False
        try:
            size = min(_BLOCK, max(1, len(items) // (_BLOCKS * self._jobs)))
            blocks = -(-len(items) // size)
            dataset = self._data.from_items(items, override_num_blocks=blocks).map_batches(
                _Actor,
                fn_constructor_args=[self._job],
                batch_size=None,
                num_cpus=_CORES,
                compute=self._data.ActorPoolStrategy(min_size=1, max_size=self._jobs),
            )
            for row in dataset.iter_rows():
                # Written by this batch's own actors, in _Actor, and carried by Ray alone.
                reply = pickle.loads(row["reply"])
                if isinstance(reply, DynacomError):
                    raise reply
                yield reply
        finally:
            context.enable_progress_bars = bars

    def close(self) -> None:
        """Ends Ray, if it was started here."""
        if self._shut_down is not None:
            self._shut_down()


class _Actor:
    """Judges blocks of files."""

    def __init__(self, job: Job) -> None:
        self._pool = Pool(job, 1)

    def __call__(self, block: dict[str, Any]) -> dict[str, list[bytes]]:
        # Written by the batch that started this actor, and carried by Ray alone.
        tasks = [Task(*pickle.loads(task)) for task in block["task"]]
        replies: list[Done | DynacomError] = []
        try:
            replies += [done for done in self._pool.run(tasks) if done is not None]
        except DynacomError as error:
            replies.append(error)
        return {"reply": [pickle.dumps(reply) for reply in replies]}

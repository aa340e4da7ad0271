# SPDX-License-Identifier: BSD-2-Clause
"""The folder of a batch: rows are written as they come, and put in order at the end.

clips.parquet       the table: when the batch has ended
parts/*.parquet     rows, as they came
frames/             tables of frames, on demand
repaired/           motions, on demand
.lock               held by the batch that writes
"""

import fcntl
import os
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet

from dynacom.batch_repair import WRITING
from dynacom.batch_row import Job, Row
from dynacom.errors import DynacomError

# Rows that a part has at most, and for how long they are kept back.
_PART_ROWS = 1000
_PART_SECONDS = 2.0
# Of the final table: what is read and written at a time.
_GROUP_ROWS = 1_000


class Store:
    """A batch's results in their folder."""

    def __init__(self, folder: Path, job: Job, names: Sequence[str]) -> None:
        """Of a folder that is there, and locked: see :meth:`open`."""
        self._folder = folder
        self._parts = folder / "parts"
        self._schema = job.schema()
        self._index = {name: index for index, name in enumerate(names)}
        #: Of each file, the part that has its rows; -1 where there is none.
        self._part_of = np.full(len(names), -1, dtype=np.int32)
        self._digests: dict[int, str | None] = {}
        self._repaired: dict[int, str] = {}
        self._number = 0
        self._rows: list[Row] = []
        self._waiting: list[int] = []
        self._written = time.monotonic()

    @property
    def table(self) -> Path:
        """The file of the table."""
        return self._folder / "clips.parquet"

    @classmethod
    @contextmanager
    def open(cls, folder: Path, job: Job, names: Sequence[str], resume: bool) -> Iterator["Store"]:
        """The results in a folder, which nobody else may change meanwhile.

        Args:
            folder: made if it is not there.
            names: of all files, in the table's order.
            resume: whether to go on where another batch has ended or was ended.

        Raises:
            DynacomError: the folder cannot be written to, or another batch is writing to it; it has
                results, and `resume` is false.
        """
        with writing(folder):
            (folder / "parts").mkdir(parents=True, exist_ok=True)
            lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        # Before it makes its first array, pyarrow imports pandas, if that is there: better while
        # worker processes start than while they wait for the next clip.
        pyarrow.array([])
        try:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise DynacomError(f"{folder}: another batch is writing to it") from None
            store = cls(folder, job, names)
            with writing(folder):
                store._load(resume)
            yield store
        finally:
            os.close(lock)

    def known(self, index: int) -> str | None:
        """The SHA-256 of a file whose rows are known; None if it had none, or killed its worker."""
        return self._digests.get(index)

    def repaired(self, index: int) -> str | None:
        """The file of repaired motions that rows tell of, from the folder; None if of none."""
        return self._repaired.get(index)

    def add(self, index: int, rows: list[Row]) -> None:
        """Adds the rows of a file. They are safe after some seconds, or :meth:`flush`.

        Raises:
            DynacomError: they cannot be written.
        """
        self._rows += rows
        self._waiting.append(index)
        if len(self._rows) >= _PART_ROWS:
            self.flush()
        else:
            self.tick()

    def tick(self) -> None:
        """To be called now and then: writes what has waited for long.

        Raises:
            DynacomError: it cannot be written.
        """
        if time.monotonic() - self._written > _PART_SECONDS:
            self.flush()

    def flush(self) -> None:
        """Writes what is not yet written.

        Raises:
            DynacomError: it cannot be written.
        """
        self._written = time.monotonic()
        if not self._rows:
            return
        table = pyarrow.Table.from_pylist(self._rows, self._schema)
        number = self._number + 1
        with writing(self._folder), whole(self._part(number)) as temporary:
            pyarrow.parquet.write_table(table, temporary)
        self._number = number
        self._part_of[self._waiting] = number
        self._rows, self._waiting = [], []

    def finish(self) -> None:
        """Writes the table, and removes parts that have nothing for it.

        Raises:
            DynacomError: it cannot be written.
        """
        self.flush()
        with writing(self._folder):
            with (
                whole(self.table) as temporary,
                pyarrow.parquet.ParquetWriter(temporary, self._schema) as writer,
            ):
                for table in self._in_order():
                    writer.write_table(table)
            for number in self._numbers():
                if number not in self._part_of:
                    self._part(number).unlink()
        self._remove_unfinished()

    def _in_order(self) -> Iterator[pyarrow.Table]:
        """The rows in the order of the files, without more in memory than must be.

        Files come nearly in order, so the first rows of what is left of the parts are in few parts.
        """
        if not len(self._part_of):
            return
        first: dict[int, int] = {}
        for index in range(len(self._part_of) - 1, -1, -1):
            first[int(self._part_of[index])] = index
        numbers = sorted(first, key=first.get)
        limits = [first[number] for number in numbers[1:]] + [len(self._part_of)]
        pending = self._schema.empty_table()
        indices = np.empty(0, dtype=int)
        for number, limit in zip(numbers, limits, strict=True):
            table, own = self._read(number)
            mine = np.flatnonzero((own >= 0) & (self._part_of[own] == number))
            pending = pyarrow.concat_tables([pending, table.take(mine)])
            indices = np.concatenate([indices, own[mine]])
            is_last = limit == len(self._part_of)
            if not is_last and np.count_nonzero(indices < limit) < _GROUP_ROWS:
                continue
            order = np.argsort(indices, kind="stable")
            pending, indices = pending.take(order), indices[order]
            count = int(np.searchsorted(indices, limit))
            yield pending.slice(0, count)
            pending, indices = pending.slice(count).combine_chunks(), indices[count:]

    def _read(self, number: int) -> tuple[pyarrow.Table, np.ndarray]:
        """A part, and which file each row is of."""
        table = pyarrow.parquet.read_table(self._part(number), schema=self._schema)
        names = table["file"].to_pylist()
        return table, np.array([self._index.get(name, -1) for name in names], dtype=int)

    def _load(self, resume: bool) -> None:
        """Finds out what is known, and removes what was being written.

        Raises:
            DynacomError: there are results, and `resume` is false.
        """
        numbers = self._numbers()
        if not resume and (numbers or self.table.exists()):
            raise DynacomError(
                f"{self._folder}: has results of a batch: --resume (resume=True) goes on with it"
            )
        for temporary in [*self._folder.glob(".*.tmp"), *self._parts.glob(".*.tmp")]:
            temporary.unlink()
        self._remove_unfinished()
        self._number = max(numbers, default=0)
        key = self._schema.metadata[b"dynacom.key"]
        for number in numbers:
            try:
                file = pyarrow.parquet.ParquetFile(self._part(number))
                if (file.schema_arrow.metadata or {}).get(b"dynacom.key") != key:
                    continue
                table = file.read(["file", "sha256", "repair_file"])
            except pyarrow.ArrowInvalid:
                continue  # the machine has crashed
            columns = (column.to_pylist() for column in table)
            for name, digest, repaired in zip(*columns, strict=True):
                if (index := self._index.get(name)) is None:
                    continue
                if self._part_of[index] != number:  # the rows before are of no use any more
                    self._repaired.pop(index, None)
                self._digests[index] = digest
                self._part_of[index] = number
                if repaired is not None:
                    self._repaired[index] = repaired

    def _remove_unfinished(self) -> None:
        """What workers were writing when they ended."""
        for results in ("frames", "repaired"):
            shutil.rmtree(self._folder / results / WRITING, ignore_errors=True)

    def _part(self, number: int) -> Path:
        return self._parts / f"part-{number:08}.parquet"

    def _numbers(self) -> list[int]:
        return sorted(int(path.stem[5:]) for path in self._parts.glob("part-*.parquet"))


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Makes an OSError a DynacomError that says where nothing can be written."""
    try:
        yield
    except OSError as error:
        raise DynacomError(f"{folder}: cannot be written ({error.strerror or error})") from error


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A temporary file that becomes path when all has gone well, and is on the disk then."""
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise

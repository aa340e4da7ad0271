# SPDX-License-Identifier: BSD-2-Clause
"""Motions from and into Parquet files, with the columns of CSV with a header."""

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dynacom.errors import DynacomError
from dynacom.motion_change import Change
from dynacom.motion_clip import Clip, Options
from dynacom.motion_columns import changed_columns, clip_from_columns, is_contact
from dynacom.motion_mark import MARK, is_mark, mark_text
from dynacom.robots import Robot

if TYPE_CHECKING:
    import pyarrow
    from pyarrow import parquet


def read_parquet(path: Path, robot: Robot, options: Options) -> Clip:
    """Reads .parquet.

    Raises:
        DynacomError: as :func:`read_motion`; or pyarrow is not installed.
        OSError: the file cannot be read.
    """
    _, table = _load(path)
    exact = is_mark((table.schema.metadata or {}).get(MARK.encode()))
    return clip_from_columns(path, robot, _numbers(path, table), options, exact=exact)


def write_parquet(change: Change) -> bytes:
    """The file with a change: schema, metadata, codecs and row groups are kept.

    Raises:
        DynacomError: as :func:`write_motion`.
        OSError: the file cannot be read.
    """
    import pyarrow
    from pyarrow import parquet, types

    path = change.clip.path
    file, table = _load(path)
    step = 0.0
    for name, values in changed_columns(change, _numbers(path, table)).items():
        place = table.schema.get_field_index(name)
        field = table.schema.field(place)
        if values is None:
            table = table.remove_column(place)
            continue
        if types.is_integer(field.type) and (values != np.rint(values)).any():
            field = field.with_type(pyarrow.float64())
            change.notes.append(f"The column {name} was of integers, and is of real numbers now.")
        if types.is_floating(field.type):
            values = values.astype(field.type.to_pandas_dtype())
            if not is_contact(name):
                step = max(step, float(np.spacing(np.abs(values).max())))
        table = table.set_column(place, field, pyarrow.array(values).cast(field.type))
    change.note_rounding(step)
    metadata = {k: v for k, v in (table.schema.metadata or {}).items() if k != MARK.encode()}
    if change.mark:
        metadata[MARK.encode()] = mark_text().encode()
    group = file.metadata.row_group(0)
    chunks = [group.column(column) for column in range(group.num_columns)]
    kept = set(table.column_names)
    content = io.BytesIO()
    parquet.write_table(
        table.replace_schema_metadata(metadata),
        content,
        row_group_size=group.num_rows,
        compression={
            chunk.path_in_schema: chunk.compression.replace("UNCOMPRESSED", "NONE")
            for chunk in chunks
            if chunk.path_in_schema in kept
        },
    )
    return content.getvalue()


def _load(path: Path) -> "tuple[parquet.ParquetFile, pyarrow.Table]":
    """The file, whose footer alone can be read any more, and all that is in it."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise DynacomError(
            f"{path}: Parquet needs pyarrow, which is not installed: pip install dynacom[motion]"
        ) from error
    with path.open("rb") as file:
        try:
            opened = parquet.ParquetFile(file)
            return opened, opened.read()
        except (pyarrow.ArrowException, OSError) as error:  # Arrow's OSError is of broken files
            raise DynacomError(f"{path}: must be a Parquet file ({error})") from error


def _numbers(path: Path, table: "pyarrow.Table") -> dict[str, np.ndarray]:
    """The columns by their names."""
    from pyarrow import types

    columns = {}
    for field, column in zip(table.schema, table.columns, strict=True):
        if field.name in columns:
            raise DynacomError(f"{path}: column '{field.name}' is there more than once")
        if not (
            types.is_floating(field.type)
            or types.is_integer(field.type)
            or types.is_boolean(field.type)
        ):
            raise DynacomError(f"{path}: column '{field.name}' must be numbers, got {field.type}")
        if column.null_count:
            frame = column.is_null().to_numpy().argmax()
            raise DynacomError(
                f"{path}: column '{field.name}' must be numbers, got null in frame {frame}"
            )
        columns[field.name] = column.to_numpy().astype(float)
    return columns

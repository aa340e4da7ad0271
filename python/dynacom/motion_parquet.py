# SPDX-License-Identifier: BSD-2-Clause
"""Motions from Parquet files, with the columns of CSV with a header."""

from pathlib import Path

from dynacom.errors import DynacomError
from dynacom.motion_clip import Clip, Options
from dynacom.motion_columns import clip_from_columns
from dynacom.robots import Robot


def read_parquet(path: Path, robot: Robot, options: Options) -> Clip:
    """Reads .parquet.

    Raises:
        DynacomError: as :func:`read_motion`; or pyarrow is not installed.
        OSError: the file cannot be read.
    """
    try:
        import pyarrow
        from pyarrow import parquet, types
    except ImportError as error:
        raise DynacomError(
            f"{path}: Parquet needs pyarrow, which is not installed: pip install dynacom[motion]"
        ) from error
    with path.open("rb") as file:
        try:
            table = parquet.ParquetFile(file).read()
        except (pyarrow.ArrowException, OSError) as error:  # Arrow's OSError is of broken files
            raise DynacomError(f"{path}: must be a Parquet file ({error})") from error
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
    return clip_from_columns(path, robot, columns, options)

"""What the tables of all categories share: identity and time of records, labels, units."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.formats.asterix import Records, letters
from boresight.formats.clock import Clock
from boresight.formats.decoding import Batch
from boresight.formats.plausible import time_of_day
from boresight.formats.wire import Flags, Integers

if TYPE_CHECKING:
    import polars as pl

Floats = NDArray[np.float64]
Columns = dict[str, Any]

FOOT_M = 0.3048
FLIGHT_LEVEL_M = 100 * FOOT_M
NAUTICAL_MILE_M = 1852.0
KNOT_MPS = NAUTICAL_MILE_M / 3600


class Stamp(NamedTuple):
    """When, whose and where in the file the records of a batch are."""

    time_s: Floats  # (n,)
    sensor: Integers  # (n,) SAC * 256 + SIC
    place: Integers  # (n,)


def stamp(batch: Batch, clock: Clock) -> Stamp:
    """Read source and unwrapped time of every record."""
    records = batch.records
    sensor = records.raw("010/SAC") << 8 | records.raw("010/SIC")
    place = batch.base + records.start
    return Stamp(clock.unwrap(sensor, time_of_day(records), place), sensor, place)


def sensor_name(code: int) -> str:
    """Return "SAC/SIC"."""
    return f"{code >> 8}/{code & 255}"


def labels(
    codes: Integers, is_there: Flags, render: Callable[[Integers], list[str | None]]
) -> "pl.Series":
    """Return text for whole numbers, each different number rendered once; null where absent."""
    import polars as pl

    values, index = np.unique(codes, return_inverse=True)
    texts = pl.Series(render(values), dtype=pl.String)
    picked = texts.gather(index.astype(np.uint32))
    mask = pl.Series(is_there)
    return pl.select(pl.when(mask).then(picked)).to_series()


def sensors(codes: Integers) -> "pl.Series":
    """Return "SAC/SIC" of each row."""
    return labels(codes, np.ones(len(codes), bool), lambda n: [sensor_name(c) for c in n.tolist()])


def addresses(records: Records, path: str) -> "pl.Series":
    """Return 24-bit addresses as six hexadecimal digits."""
    return labels(
        records.raw(path), records.has(path), lambda n: [f"{code:06X}" for code in n.tolist()]
    )


def octal(records: Records, path: str) -> "pl.Series":
    """Return a Mode A code as four octal digits."""
    item = path.rpartition("/")[0]
    return labels(
        records.raw(path), records.has(item), lambda n: [f"{code:04o}" for code in n.tolist()]
    )


def text(records: Records, path: str) -> "pl.Series":
    """Return text without padding, null where absent or blank."""
    cells = records.cells(path)
    field = cells.field if cells else None

    def render(codes: Integers) -> list[str | None]:
        if field is None:
            return [None] * len(codes)
        found = np.strings.rstrip(letters(codes, field), b" ").tolist()
        return [code.decode("latin-1") or None for code in found]

    return labels(records.raw(path), records.raw(path, absent=-1) >= 0, render)


def flags(values: Flags, is_there: Flags) -> "pl.Series":
    """Return booleans, null where absent."""
    import polars as pl

    return pl.select(pl.when(pl.Series(is_there)).then(pl.Series(values))).to_series()


def whole(values: Integers, is_there: Flags) -> "pl.Series":
    """Return whole numbers, null where absent."""
    import polars as pl

    return pl.select(pl.when(pl.Series(is_there)).then(pl.Series(values))).to_series()


def frame(columns: Columns) -> "pl.DataFrame":
    """Return a table; NaN becomes null."""
    import polars as pl

    return pl.DataFrame(columns, nan_to_null=True)

"""Which edition a source writes: the one whose reading makes sense, not the one that merely parses.

A wrong edition often parses: 42,450 "records" of edition 2.6 come out of 24,581 of edition 0.23.
So a reading is scored by what must hold for a radar or a ground station: blocks end where their
records do, every record names its source, times of day go forward, spare bits are zero, values
are physical, an aircraft flies no faster than a kilometre a second. Editions that score alike read
alike; of them the newest is named.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.formats.asterix import Records, decode, read_bits
from boresight.formats.specs import Edition, Shape, editions
from boresight.formats.wire import Integers, Octets

DAY_S = 86_400
_SAMPLE = 600  # blocks
_RUNS = 3  # stretches of neighbouring blocks the sample is made of
_ALIKE = 1e-3  # scores closer than this are the same: one odd record in a thousand decides nothing

# Times of day, one of which a record of the category has (s); and what must lie between bounds.
TIMES = {
    10: ("140",),
    21: ("030", "071", "073", "075", "077"),
    34: ("030",),
    48: ("140",),
    62: ("070",),
}
_BOUNDS = {
    10: {"091": (-2_000, 60_000), "090/FL": (-20, 1_000)},
    21: {"130/LAT": (-90, 90), "130/LON": (-180, 180), "145": (-20, 1_500)},
    34: {"120/LAT": (-90, 90), "120/LON": (-180, 180)},
    48: {"090/FL": (-20, 1_500), "040/RHO": (0, 256)},
    62: {"105/LAT": (-90, 90), "105/LON": (-180, 180), "136": (-20, 1_500)},
}
_PLACES = {21: ("080", "130/LAT", "130/LON"), 62: ("040", "105/LAT", "105/LON")}


class Choice(NamedTuple):
    """An edition, the share of the sample that makes sense, and the editions that read it alike."""

    edition: Edition
    score: float
    alike: tuple[str, ...]


def choose(octets: Octets, starts: Integers, ends: Integers, category: int) -> Choice:
    """Choose the edition of blocks of one category and source, in the order of the file."""
    picked = _sample(len(starts))
    readings = [
        decode(octets, starts[picked], ends[picked], edition) for edition in editions(category)
    ]
    scores = [plausibility(reading) for reading in readings]
    best = max(scores)
    alike = [r.edition for r, s in zip(readings, scores, strict=True) if s >= best - _ALIKE]
    return Choice(alike[-1], best, tuple(edition.name for edition in alike))


def _sample(count: int) -> NDArray[np.intp]:
    if count <= _SAMPLE:
        return np.arange(count)
    run = np.arange(_SAMPLE // _RUNS)
    return np.concatenate([run + int(start) for start in np.linspace(0, count - len(run), _RUNS)])


def plausibility(records: Records) -> float:
    """Return the share of a reading that makes sense, from 0 to 1."""
    if not len(records):
        return 0.0
    shares = (
        records.is_good.mean(),
        records.has("010").mean(),
        _times_go_forward(records),
        _spares_are_zero(records),
        _values_are_physical(records),
        _places_connect(records),
    )
    return float(np.prod(shares))


def time_of_day(records: Records) -> NDArray[np.float64]:
    """Return (n,) seconds since midnight, of the first time item that a record has."""
    times = np.full(len(records), np.nan)
    for path in TIMES[records.edition.category]:
        times = np.where(np.isnan(times), records.value(path), times)
    return times


def _times_go_forward(records: Records) -> float:
    """Steps between neighbours: in the day, not backwards by over 10 s, not forward by a minute."""
    times = time_of_day(records)
    times = times[~np.isnan(times)]
    if not len(times):
        return 1.0
    in_day = (times < DAY_S).mean()
    steps = (np.diff(times) + DAY_S / 2) % DAY_S - DAY_S / 2
    return float(in_day * ((steps > -10) & (steps < 60)).mean() if len(steps) else in_day)


def _spares_are_zero(records: Records) -> float:
    is_zero = np.ones(len(records), bool)
    for frn, slot in enumerate(records.edition.record.slots):
        if slot is not None and slot.shape.kind in ("fixed", "extended"):
            rows = np.flatnonzero(records.offsets[frn] >= 0)
            at = records.offsets[frn, rows].astype(np.int64)
            is_zero[rows] &= ~_any_spare(records.buffer, at, slot.shape)
    return float(is_zero.mean())


def _any_spare(buffer: Octets, at: Integers, shape: Shape) -> NDArray[np.bool_]:
    """Return whether a spare bit is set in the first part, which every such item has."""
    first_part = 8 * (shape.size or shape.parts[0])
    found = np.zeros(len(at), bool)
    for field in shape.fields:
        if field.kind == "-" and field.offset < first_part and field.width <= 64:
            found |= read_bits(buffer, at, field) != 0
    return found


def _values_are_physical(records: Records) -> float:
    is_physical = np.ones(len(records), bool)
    for path, (low, high) in _BOUNDS[records.edition.category].items():
        values = records.value(path)
        is_physical &= np.isnan(values) | ((values >= low) & (values <= high))
    return float(is_physical.mean())


def _places_connect(records: Records) -> float:
    """Share of steps of the same aircraft, up to a minute, no faster than a kilometre a second."""
    paths = _PLACES.get(records.edition.category)
    if paths is None:
        return 1.0
    who = records.raw(paths[0], absent=-1)
    order = np.argsort(who, kind="stable")
    latitude, longitude = (records.value(path)[order] for path in paths[1:])
    seconds = np.diff(time_of_day(records)[order])
    north = np.diff(latitude) * 111_000
    east = np.diff(longitude) * 111_000 * np.cos(np.radians(latitude[1:]))
    metres = np.hypot(north, east)
    counts = (np.diff(who[order]) == 0) & (seconds >= 0) & (seconds < 60) & ~np.isnan(metres)
    return float((metres < 1_000 * seconds + 500)[counts].mean()) if counts.any() else 1.0

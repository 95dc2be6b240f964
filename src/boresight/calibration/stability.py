"""Whether a radar errs alike in all directions and all the time: sectors, spells, drift, steps.

Each number is an estimate with an interval clustered by target (`levels`). Many are looked at, so
what is called more than chance must be so after the number of looks is allowed for (Bonferroni):
a radar that is stable gets a remark in less than one recording in twenty.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.calibration import steps
from boresight.calibration.bins import Bins, joined
from boresight.calibration.levels import FEWEST, Estimates, estimate
from boresight.calibration.pairs import Pairs
from boresight.calibration.residuals import Registered, at_door, medians, place, spread

if TYPE_CHECKING:
    import polars as pl

Array = Any
_SECTOR_DEG = 10.0
_SPELLS, _PAIRS_A_SPELL = 24, 200
_ROWS = 30  # of an interval, at least
_GROSS = 5.0  # robust standard deviations about an interval's median: no measurement of its target
_CHANCE = 0.01  # of a false remark, for each of sectors, spells, drift
_HOUR_S = 3_600.0
_UNITS = {"m": " m", "deg": "°"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Stability:
    """How a radar's errors differ from their fit by direction and by time.

    Attributes:
        tables: `sectors` (azimuth_from_deg, azimuth_to_deg, pairs, targets, range_m, range_sd_m,
            azimuth_deg, azimuth_sd_deg; half-widths range_ci95_m, azimuth_ci95_deg), the error
            against the mean over the sectors that agree; `over_time` (time_from_s, time_to_s and
            the same); `drift` (channel, per_hour, sd, low, high) and `steps` (channel, time_s,
            size, sd, low, high). Each sd is that of the estimate, clustered by target, infinite of
            fewer than three.
        remarks: what is more than chance, in sentences.
    """

    tables: "dict[str, pl.DataFrame]" = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)


def stability(pairs: Pairs, registration: Registered) -> Stability:
    """What is left after a registration, by sector and over time.

    Args:
        pairs: m pairs.
        registration: of these pairs; only what is left of them counts here, not what it took for an
            outlier: a whole sector that errs would be one.
    """
    if not len(pairs):
        return Stability()
    order = np.lexsort((pairs.time_s, pairs.target))  # once, which makes what follows quick
    order = order[_of_their_targets(pairs, registration.after)[pairs.target[order]]]
    pairs = pairs.take(order)
    left = at_door(pairs, registration.after[order])
    sectors, remarks = _sectors(pairs, left)
    over_time, spells = _over_time(pairs, left)
    changes, told = _changes(pairs, left)
    tables = {"sectors": sectors, "over_time": over_time, **changes}
    return Stability(tables=tables, remarks=remarks + (told or spells))


def _of_their_targets(pairs: Pairs, after: Array) -> Array:
    """(targets,) False for those that err as a whole as no other does: of a wrong reference."""
    targets = len(pairs.names)
    good = np.ones(targets, dtype=bool)
    for y in after.T:
        level = medians(y, pairs.target, targets)
        scatter = np.nanmedian(spread(y, pairs.target, targets)) if np.isfinite(y).any() else 0.0
        one = np.zeros(targets, dtype=int)
        off = np.abs(level - medians(level, one, 1))
        good &= ~(off > _GROSS * max(float(spread(level, one, 1)[0]), scatter))
    return good


def _sectors(pairs: Pairs, left: dict[str, Array]) -> "tuple[pl.DataFrame, list[str]]":
    edges = np.arange(0.0, 360.0 + _SECTOR_DEG, _SECTOR_DEG)
    bins = joined(place(pairs)[1], edges, pairs.target, rows=_ROWS, targets=FEWEST)
    return _by_interval("azimuth", "deg", bins, pairs, left)


def _over_time(pairs: Pairs, left: dict[str, Array]) -> "tuple[pl.DataFrame, list[str]]":
    bins = joined(pairs.time_s, _spells(pairs), pairs.target, rows=_ROWS, targets=FEWEST)
    return _by_interval("time", "s", bins, pairs, left)


def _spells(pairs: Pairs) -> Array:
    """Edges of equal spells of the recording, as many as its pairs bear."""
    count = int(np.clip(len(pairs) // _PAIRS_A_SPELL, 1, _SPELLS))
    first, last = float(pairs.time_s.min()), float(pairs.time_s.max())
    edges = np.linspace(first, last, count + 1)
    edges[-1] = np.nextafter(last, np.inf)
    return edges


def _by_interval(
    name: str, unit: str, bins: Bins, pairs: Pairs, left: dict[str, Array]
) -> "tuple[pl.DataFrame, list[str]]":
    """Table of the mean error in each interval, and what of it is beyond chance."""
    import polars as pl

    inside = bins.index >= 0
    seen = np.zeros((len(bins), len(pairs.names)), dtype=bool)
    seen[bins.index[inside], pairs.target[inside]] = True
    columns = {
        f"{name}_from_{unit}": bins.low,
        f"{name}_to_{unit}": bins.high,
        "pairs": np.bincount(bins.index[inside], minlength=len(bins)),
        "targets": seen.sum(axis=1),
    }
    said = []
    for channel, y in left.items():
        what, channel_unit = channel.rsplit("_", 1)
        found, beyond = _means(y, bins, pairs.target, looks=len(bins) * len(left))
        columns[channel] = found.value
        columns[f"{what}_sd_{channel_unit}"] = found.sd
        columns[f"{what}_ci95_{channel_unit}"] = found.half_width()
        said += _worst(name, bins, channel, found, np.flatnonzero(beyond))
    return pl.DataFrame(columns), said


def _means(y: Array, bins: Bins, target: Array, looks: int) -> tuple[Estimates, Array]:
    """Mean of each interval against the mean over those that agree, and which do not.

    What differs beyond chance leaves the mean that all are held against, the worst first: one bad
    sector must not make the others look bad.
    """
    cell, who, count, mean = _cells(y, bins, target)
    told = np.bincount(cell, minlength=len(bins)) >= FEWEST
    rows, each = told[cell], np.eye(len(bins))
    share = np.bincount(cell, weights=count * rows, minlength=len(bins))
    agree = told.copy()
    while told.any():
        rest = agree * share / (agree @ share) if told.sum() > 1 else 0.0
        found = estimate(each[cell[rows]], mean[rows], count[rows], who[rows], each - rest)
        beyond = (found.chance() * looks < _CHANCE) & told & (told.sum() > 1)
        far = np.abs(found.value) * (beyond & agree)
        worst = far > 0.5 * far.max()
        if not worst.any() or (agree & ~worst) @ share < 0.5 * share.sum():
            value, sd = np.where(told, found.value, np.nan), np.where(told, found.sd, np.inf)
            return found._replace(value=value, sd=sd), beyond
        agree &= ~worst
    nothing = np.full(len(bins), np.nan)
    return Estimates(nothing, np.full(len(bins), np.inf), np.ones(len(bins))), told


def _cells(y: Array, bins: Bins, target: Array, *more: Array) -> tuple[Array, ...]:
    """Means over the plots of one target in one interval, without gross ones.

    Returns:
        (r,) interval, target, number of plots and mean of y, then means of `more`.
    """
    off = np.abs(y - medians(y, bins.index, len(bins))[bins.index])
    scale = spread(y, bins.index, len(bins))
    least = np.nanmedian(scale) if np.isfinite(scale).any() else 0.0  # of all, where few are alike
    good = (bins.index >= 0) & (off <= _GROSS * np.maximum(scale, least)[bins.index])
    key = target[good] * len(bins) + bins.index[good]
    count = np.bincount(key)
    cells = np.flatnonzero(count)
    means = [np.bincount(key, x[good])[cells] / count[cells] for x in (y, *more)]
    return cells % len(bins), cells // len(bins), count[cells].astype(float), *means


def _worst(name: str, bins: Bins, channel: str, found: Estimates, beyond: Array) -> list[str]:
    """One sentence on the intervals that differ by more than chance, and on the worst of them."""
    if not len(beyond):
        return []
    worst = beyond[np.argmax(np.abs(found.value[beyond]))]
    kind, unit = {"azimuth": ("sector", "°"), "time": ("spell", " s")}[name]
    what, size = channel.rsplit("_", 1)[0], sizes(channel, found)[worst]
    where = f"from {bins.low[worst]:.0f}{unit} to {bins.high[worst]:.0f}{unit}"
    how_many = f"{len(beyond)} of {len(bins)} {kind}s"
    told = f"In {how_many} the {what} errs otherwise than in the others, beyond chance"
    return [f"{told}: by {size} in the {kind} {where}."]


def _changes(pairs: Pairs, left: dict[str, Array]) -> "tuple[dict[str, pl.DataFrame], list[str]]":
    """Drift and steps, estimated together so that neither is taken for the other."""
    drifts, jumps, said = [], [], []
    for channel, y in left.items():
        at, found = _found(pairs, y)
        if found is None:
            continue
        half = found.half_width()
        rows = [
            (channel, float(v), float(s), float(v - h), float(v + h))
            for v, s, h in zip(found.value, found.sd, half, strict=True)
        ]
        drifts.append(rows[0])
        jumps += [(row[0], float(t), *row[1:]) for t, row in zip(at, rows[1:], strict=True)]
        said += _told(channel, at, found, looks=len(left))
    drift = _frame(drifts, "channel", "per_hour", "sd", "low", "high")
    step = _frame(jumps, "channel", "time_s", "size", "sd", "low", "high")
    return {"drift": drift, "steps": step}, said


def _frame(rows: list[Any], *names: str) -> "pl.DataFrame":
    """Rows of a channel's name and numbers; none of them is a table too."""
    import polars as pl

    numbers = dict.fromkeys(names[1:], pl.Float64)
    return pl.DataFrame(rows, {names[0]: pl.String, **numbers}, orient="row")


def _found(pairs: Pairs, y: Array) -> tuple[Array, Estimates | None]:
    """Times of the steps that stay (what passes is a disturbance), and all sizes, drift first."""
    at = steps.find(pairs.time_s, pairs.target, y)
    found = _trend(pairs, y, at)
    if found is None or (found.chance()[1:] < _CHANCE).all():
        return at, found
    at = at[found.chance()[1:] < _CHANCE]
    return at, _trend(pairs, y, at)


def _trend(pairs: Pairs, y: Array, at: Array) -> Estimates | None:
    """Slope per hour and the size of each step; None where there is no time to have one."""
    edges = np.unique(np.concatenate([_spells(pairs), at]))
    bins = joined(pairs.time_s, edges, pairs.target, rows=1, targets=1)
    cell, who, count, mean, hours = _cells(y, bins, pairs.target, pairs.time_s / _HOUR_S)
    if np.ptp(hours) <= 0.0 or len(np.unique(who)) < FEWEST:
        return None
    later = [(bins.low[cell] >= t).astype(float) for t in at]
    X = np.column_stack([np.ones(len(hours)), hours - hours.mean(), *later])
    return estimate(X, mean, count, who, np.eye(X.shape[1])[1:])


def _told(channel: str, at: Array, found: Estimates, looks: int) -> list[str]:
    what, (slope, *jumps) = channel.rsplit("_", 1)[0], sizes(channel, found)
    said = [
        f"At {t:.0f} s the {what} of all targets steps by {size}."
        for t, size in zip(at, jumps, strict=True)
    ]
    if found.chance()[0] * looks < _CHANCE:
        said.append(f"The {what} drifts by {slope} an hour, beyond chance.")
    return said


def sizes(channel: str, found: Estimates) -> list[str]:
    """Each value with half of its 95 % interval, to two digits of the latter."""
    unit = _UNITS[channel.rsplit("_", 1)[1]]
    out = []
    for value, half in zip(found.value, found.half_width(), strict=True):
        digits = max(0, 1 - int(np.floor(np.log10(half)))) if 0.0 < half < np.inf else 2
        out.append(f"{value:+.{digits}f} ± {half:.{digits}f}{unit}")
    return out

"""Plots beside their reference: which plot is of which target, and where that target then was."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.calibration.comparing import HEIGHTS, Compared, Setting, compare, has_identity
from boresight.calibration.due import due_scans
from boresight.calibration.faults import explain
from boresight.calibration.matching import FEWEST_HITS
from boresight.calibration.pairs import Pairs
from boresight.calibration.references import Reference
from boresight.calibration.same_day import same_day
from boresight.errors import UsageError
from boresight.formats.usable import column
from boresight.maths.frames import Site
from boresight.models.atmosphere import Atmosphere

if TYPE_CHECKING:
    import polars as pl

Array = Any
GATE_M = 60.0
_FULL = 0.25  # of the pairs in the outer half of the gate: more than the tails of a bell


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairing:
    """Plots of one radar beside a reference.

    Attributes:
        pairs: what made a pair.
        reason: (n,) for each plot why it made none, of `matching.MEANINGS`; empty where it did.
        dropped: number of plots by reason, most frequent first.
        how: "identity" or "position".
        scan_s: of the radar.
        due: where each target was at every scan at which the radar should have seen it, by name
            and time; see `calibration.due`.
        remarks: sentences for the reader.
    """

    pairs: Pairs
    reason: Array
    dropped: dict[str, int]
    how: str
    scan_s: float
    due: "pl.DataFrame"
    remarks: list[str]


def pair(
    plots: "pl.DataFrame",
    reference: Reference,
    site: Site,
    *,
    gate_m: float = GATE_M,
    atmosphere: Atmosphere | None = None,
) -> Pairing:
    """Find for every plot the target of the reference, and where it was at the plot's time.

    Identity decides where plots and reference tell one: the 24-bit address, else Mode A code and
    time. Only where they do not, position decides, within the gate. What is not certain is dropped
    and counted.

    Args:
        plots: of one sensor, see `boresight.formats.plots`; in any order.
        reference: see `boresight.calibration.references`.
        site: of the radar.
        gate_m: greatest distance of plot and target where the radar tells no identity, m.
        atmosphere: whose delay and bending are taken out of the plots; None for a vacuum.

    Returns:
        Pairs in the order of the plots.

    Raises:
        UsageError: the gate is no distance.
        DataError: nothing can be paired, or clock, place or unit are wrong; it says which.
    """
    if not (np.isfinite(gate_m) and gate_m > 0):
        raise UsageError(f"a gate of {gate_m!r} m is no distance", next_step="give metres above 0")
    reference, remarks = same_day(plots, reference)
    how = "identity" if has_identity(plots, reference) else "position"
    setting = Setting(site=site, how=how, gate_m=gate_m)
    found = compare(plots, reference, setting)
    remarks += explain(plots, reference, setting, found)
    reasons, counts = np.unique(found.reason[found.reason != ""].astype(str), return_counts=True)
    order = np.argsort(-counts, kind="stable")
    return Pairing(
        pairs=_pairs(plots, reference, found, site, atmosphere),
        reason=found.reason,
        dropped={str(reasons[i]): int(counts[i]) for i in order},
        how=how,
        scan_s=found.scan_s,
        due=due_scans(plots, reference, found, site),
        remarks=remarks + _remarks(plots, found, setting),
    )


def _pairs(
    plots: "pl.DataFrame",
    reference: Reference,
    found: Compared,
    site: Site,
    atmosphere: Atmosphere | None,
) -> Pairs:
    channels, z = _measured(plots, found, site, atmosphere)
    name = reference.table["name"].gather(found.row)
    names = name.unique().sort()
    return Pairs(
        time_s=found.time,
        target=names.search_sorted(name).to_numpy().astype(int),
        names=tuple(names.to_list()),
        channels=channels,
        z=z,
        position=found.position,
        velocity=found.velocity,
        height_m=found.height,
        accuracy_m=found.paths.linear(found.paths.accuracy, found.row, found.time),
        row=found.plot,
    )


def _measured(
    plots: "pl.DataFrame", found: Compared, site: Site, atmosphere: Atmosphere | None
) -> tuple[tuple[str, ...], Array]:
    """Channels and what was measured (m, k), without the air; elevation only if any has one."""
    z = {
        "range_m": column(plots, "range_m", np.nan)[found.plot],
        "azimuth_rad": np.radians(column(plots, "azimuth_deg", np.nan)[found.plot]),
        "elevation_rad": np.radians(column(plots, "elevation_deg", np.nan)[found.plot]),
    }
    if atmosphere is not None:
        slant = np.linalg.norm(found.position, axis=1)
        z["range_m"] = z["range_m"] - atmosphere.excess_range(slant, found.height, site.height_m)
        bending = atmosphere.bending(slant, found.height, site.height_m)
        z["elevation_rad"] = z["elevation_rad"] - bending
    if not np.isfinite(z["elevation_rad"]).any():
        del z["elevation_rad"]
    return tuple(z), np.stack(list(z.values()), axis=-1)


def _remarks(plots: "pl.DataFrame", found: Compared, setting: Setting) -> list[str]:
    counts = np.bincount(found.source, minlength=len(HEIGHTS))
    told = [f"{words} ({n:,})" for words, n in zip(HEIGHTS, counts, strict=True) if n]
    remarks = [f"Heights of targets, with the number of pairs: {', '.join(told)}."]
    again = int((found.reason == "repeated").sum())
    if again:
        remarks.append(
            f"{again:,} plots repeat another's time, range, azimuth and identity: not used."
        )
    if setting.how == "position":
        remarks.append(
            f"Plots and reference share no identity: pairs are those within {setting.gate_m:g} m, "
            f"where a radar track stays with one target for {FEWEST_HITS} plots or more."
        )
        remarks += _gate(plots, found, setting.gate_m)
    return remarks


def _gate(plots: "pl.DataFrame", found: Compared, gate_m: float) -> list[str]:
    """A remark if the gate cuts pairs off: then biases seem smaller than they are."""
    distance = _distance(plots, found)
    share = float(np.mean(distance > gate_m / 2)) if len(distance) else 0.0
    if share < _FULL:
        return []
    told = (
        f"{100 * share:.0f} % of the pairs lie in the outer half of the gate of {gate_m:g} m: it "
        "cuts off plots that err more, and biases seem smaller than they are. Give a wider one "
        "(--gate) until this share is small."
    )
    return [told]


def _distance(plots: "pl.DataFrame", found: Compared) -> Array:
    """(m,) distance of each plot from its target's slant range and azimuth, m."""
    slant = np.linalg.norm(found.position, axis=1)
    azimuth = np.arctan2(found.position[:, 1], found.position[:, 0])
    measured = column(plots, "range_m", np.nan)[found.plot]
    turned = np.radians(column(plots, "azimuth_deg", np.nan)[found.plot])
    gap: Array = np.abs(measured * np.exp(1j * turned) - slant * np.exp(1j * azimuth))
    return gap

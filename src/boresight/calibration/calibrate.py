"""A calibration from end to end: plots paired with a reference, registered, and looked at again."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from boresight.calibration import downlink
from boresight.calibration.air import air_gain_m_per_km
from boresight.calibration.detection import detection_remarks, detection_tables
from boresight.calibration.pairing import GATE_M, Pairing, pair
from boresight.calibration.pairs import Pairs
from boresight.calibration.references import Reference
from boresight.calibration.registration import register
from boresight.calibration.residuals import noise_tables, residual_table
from boresight.calibration.result import Calibration, NoiseFound
from boresight.calibration.stability import Stability, stability
from boresight.errors import DataError
from boresight.formats.usable import one_sensor
from boresight.maths.frames import Site
from boresight.models.atmosphere import Atmosphere, spelled
from boresight.models.systematic import TERMS

if TYPE_CHECKING:
    import polars as pl

# What a radar may well have; the offset of its site is estimated only where it is asked for.
USUAL = (
    "range_bias_m",
    "range_gain_m_per_km",
    "azimuth_bias_deg",
    "azimuth_cos_deg",
    "azimuth_sin_deg",
    "time_bias_s",
)
_FEWEST = 3  # pairs
_DELAY_M = 225.0  # three times what half a microsecond, a transponder's tolerance, makes of range
_WRONG = 0.24  # the share of outliers is held below a quarter for wrong places
NOT_TRUTH = (
    "The reference is a centre's system tracks, made from radars (perhaps this one among them), "
    "not truth: what all of them share does not show here, and their smoothing does."
)
NO_GATE = "The gate was not used: plots and reference both tell who a target is, and that decides."


def calibrate(
    plots: "pl.DataFrame",
    reference: Reference,
    site: Site,
    *,
    sensor: str | None = None,
    terms: tuple[str, ...] | None = None,
    atmosphere: Atmosphere | None = None,
    gate_m: float | None = None,
) -> Calibration:
    """Find what is wrong with one radar.

    Args:
        plots: table of plots, as `formats.recording` reads it.
        reference: where targets were, see `calibration.references`.
        site: of the radar.
        sensor: which sensor, if the table has several; left out: the busiest.
        terms: of `models.systematic.TERMS`; left out: `USUAL`, and the elevation bias where
            elevation is measured.
        atmosphere: whose delay is taken out before; left out, a range gain contains the air's.
        gate_m: how far from its plot a target may be where the radar tells no identity.

    Raises:
        DataError: nothing can be paired, or too little; or elevation is asked for, not measured.
        UsageError: no such sensor.
    """
    remarks: list[str] = []
    mine = one_sensor(plots, sensor, remarks)
    gate = GATE_M if gate_m is None else gate_m
    pairing = pair(mine, reference, site, gate_m=gate, atmosphere=atmosphere)
    wanted = _terms(terms, pairing.pairs)
    _check_number(pairing.pairs, wanted, pairing.dropped)
    found = register(pairing.pairs, wanted)
    left = stability(pairing.pairs, found)
    tables = detection_tables(pairing, mine, site)
    remarks += [*reference.remarks, *pairing.remarks, *found.remarks, *_doubts(found.noise)]
    remarks += [NO_GATE] * (gate_m is not None and pairing.how == "identity")
    remarks += [NOT_TRUTH] * (reference.kind == "system tracks")
    return Calibration(
        errors=found.errors,
        terms=found.terms,
        directions=found.directions,
        noise=found.noise,
        pairs=len(pairing.pairs),
        targets=len(np.unique(pairing.pairs.target)),
        dropped=pairing.dropped,
        reference=reference.kind,
        sensor=_name(mine),
        site=site,
        atmosphere=spelled(atmosphere),
        air_gain_m_per_km=air_gain_m_per_km(pairing.pairs, site),
        residuals=residual_table(pairing.pairs, found),
        tables=noise_tables(pairing.pairs, found) | left.tables | tables,
        settings=_settings(wanted, reference, pairing, gate),
        remarks=[*remarks, *left.remarks, *_left_out(wanted, left), *detection_remarks(tables)],
    )


def calibrate_by_downlink(
    plots: "pl.DataFrame",
    site: Site,
    *,
    sensor: str | None = None,
    atmosphere: Atmosphere | None = None,
) -> Calibration:
    """Azimuth bias of one radar from what aircraft told it; see `calibration.downlink`."""
    remarks: list[str] = []
    found = downlink.from_downlink(one_sensor(plots, sensor, remarks), site, atmosphere=atmosphere)
    return replace(found, remarks=[*remarks, *found.remarks])


def _terms(asked: tuple[str, ...] | None, pairs: Pairs) -> tuple[str, ...]:
    measured = "elevation_rad" in pairs.channels
    if asked is None:
        return (*USUAL, *(["elevation_bias_deg"] if measured else []))
    if "elevation_bias_deg" in asked and not measured:
        raise DataError(
            "the elevation bias cannot be estimated",
            why="no plot that was paired has an elevation",
            next_step="leave elevation out of --terms",
        )
    return asked


def _check_number(pairs: Pairs, terms: tuple[str, ...], dropped: dict[str, int]) -> None:
    fewest = max(_FEWEST, len(terms))
    if len(pairs) < fewest:
        reasons = "; ".join(f"{count} plots: {why}" for why, count in dropped.items())
        raise DataError(
            f"{len(pairs)} pairs of plots and reference are too few: {len(terms)} terms need "
            f"{fewest} at least",
            why=reasons or "no plot was dropped, so the recording has no more",
            next_step="record for longer, or name fewer terms",
        )


def _left_out(terms: tuple[str, ...], left: Stability) -> list[str]:
    """Errors that are not estimated look like sectors that err, or like drift."""
    missing = [TERMS[term].words for term in USUAL if term not in terms]
    if not (missing and left.remarks):
        return []
    said = "What shows by sector or over time may be of errors that were not estimated"
    return [f"{said}: {', '.join(missing)}."]


def _doubts(noise: NoiseFound) -> list[str]:
    """What does not look like a radar whose terms were all asked for."""
    found = []
    if noise.target_range_m > _DELAY_M:
        found.append(
            f"Ranges differ by {noise.target_range_m:,.0f} m from target to target, where "
            f"transponders make {_DELAY_M / 3:.0f} m at most: a wrong site (try site among the "
            "terms) or a wrong reference would do that."
        )
    if noise.outlier_share > _WRONG:
        found.append(
            f"{100 * noise.outlier_share:.0f} % of the pairs look like no measurement of their "
            "target, as much as this fit can bear: do not trust its figures before that is "
            "explained."
        )
    return found


def _name(plots: "pl.DataFrame") -> str:
    return str(plots["sensor"][0]) if "sensor" in plots.columns else ""


def _settings(
    terms: tuple[str, ...],
    reference: Reference,
    pairing: Pairing,
    gate_m: float,
) -> dict[str, object]:
    gate = {"gate_m": gate_m} if pairing.how == "position" else {}
    return {
        "terms": list(terms),
        "paired_by": pairing.how,
        **gate,
        "longest_gap_s": reference.longest_gap_s,
        "reference_reports": reference.table.height,
        "reference_refused": dict(reference.refused),
        "scan_s": pairing.scan_s,
    }

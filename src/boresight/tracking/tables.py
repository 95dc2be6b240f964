"""A tracking result as tables, and the sentences that go with it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.maths.frames import Site, geodetic_from_enu
from boresight.tracking.flight import Filtered, Flights
from boresight.tracking.identity import MEANINGS, Sorted

if TYPE_CHECKING:
    import polars as pl

Array = Any
# ENU from the inside order North, East, up (positions, then velocities).
_ENU = (1, 0, 2, 4, 3, 5)
_ENU_PLANE = (1, 0, 3, 2)
FIXED_RANGE_M, FIXED_AZIMUTH_DEG, FIXED_PLOTS = 60.0, 0.2, 100


def column(plots: "pl.DataFrame", name: str, default: Any) -> Array:
    """A column as an array, nulls and absence filled with `default`."""
    if name not in plots.columns:
        return np.full(plots.height, default)
    return plots[name].fill_null(default).to_numpy()


def skipped_table(skipped: Array, rejected: int) -> "pl.DataFrame":
    """Every plot that was not used, by reason."""
    import polars as pl

    reasons, counts = np.unique(skipped[skipped != ""], return_counts=True)
    rows = [(str(r), int(c), MEANINGS[str(r)]) for r, c in zip(reasons, counts, strict=True)]
    if rejected:
        rows.append(("rejected", rejected, "outside the gate of its own track"))
    rows.sort(key=lambda row: -row[1])
    schema = {"reason": pl.String, "count": pl.Int64, "meaning": pl.String}
    return pl.DataFrame(rows, schema=schema, orient="row")


def nis_summary(result: Filtered, rows: Array) -> dict[str, float]:
    """Mean and median of the normalised innovation squared per degree of freedom."""
    nis, dof = result["nis"][rows], result["dof"][rows]
    total = float(dof.sum())
    return {
        "mean": float(nis.sum()) / total if total else float("nan"),
        "median": float(np.median(nis / dof)) if total else float("nan"),
        "dof": total,
        "scans": float(len(nis)),
    }


def status(result: Filtered) -> Array:
    """`updated`, `rejected`, `started` or `restarted` for each plot."""
    inside = result["inside"] > 0.5
    names = np.where(inside, "updated", "rejected")
    return np.where(result.restarts, "restarted", np.where(result.started, "started", names))


def track_table(
    plots: "pl.DataFrame", found: Sorted, flights: Flights, result: Filtered, site: Site | None
) -> "pl.DataFrame":
    """One row per track and plot; see `TrackingResult.tracks`."""
    import polars as pl

    mean, cov = result["mean"], result["cov"]
    order = list(_ENU if flights.z.shape[1] == 3 else _ENU_PLANE)
    enu, spread = mean[:, order], cov[:, order][:, :, order]
    if flights.z.shape[1] == 2:  # in the plane: no height, no vertical speed
        enu, spread = _lift(enu, spread)
    columns: dict[str, Any] = {"track": flights.track, "time_s": flights.time}
    columns |= _places(enu, site)
    names = ("east_m", "north_m", "up_m", "east_mps", "north_mps", "up_mps")
    columns |= {name: enu[:, i] for i, name in enumerate(names)}
    columns |= {f"cov_{i}_{j}": spread[:, i, j] for i in range(6) for j in range(i, 6)}
    columns |= {"nis": result["nis"], "dof": result["dof"].astype(int), "status": status(result)}
    table = pl.DataFrame(columns)
    rows = pl.Series(found.row)
    identity = [n for n in ("address", "mode_a", "aircraft_id", "sensor") if n in plots.columns]
    return table.hstack(plots.select(identity)[rows].get_columns())


def _lift(enu: Array, cov: Array) -> tuple[Array, Array]:
    full, spread = np.full((len(enu), 6), np.nan), np.full((len(enu), 6, 6), np.nan)
    places = np.array([0, 1, 3, 4])
    full[:, places] = enu
    spread[:, places[:, None], places[None, :]] = cov
    return full, spread


def _places(enu: Array, site: Site | None) -> dict[str, Array]:
    if site is None:
        unknown = np.full(len(enu), np.nan)
        return {"latitude_deg": unknown, "longitude_deg": unknown, "height_m": unknown}
    flat = np.nan_to_num(enu[:, :3]) if np.isnan(enu[:, 2]).all() else enu[:, :3]
    place = geodetic_from_enu(flat, site)
    height = np.where(np.isnan(enu[:, 2]), np.nan, place.height_m)
    return {
        "latitude_deg": place.latitude_deg,
        "longitude_deg": place.longitude_deg,
        "height_m": height,
    }


def residual_table(
    flights: Flights, result: Filtered, sensor: str, straight: Array, known: Array
) -> "pl.DataFrame":
    """One row per track and plot; see `TrackingResult.residuals`."""
    import polars as pl

    missing = (result["dof"] < 0.5)[:, None] | np.isnan(result["variance"])
    nu = np.where(missing, np.nan, result["innovation"])
    sd = np.sqrt(np.where(missing, np.nan, result["variance"]))
    nothing = np.full(len(nu), np.nan)
    has_height = nu.shape[1] == 3
    return pl.DataFrame(
        {
            "track": flights.track,
            "time_s": flights.time,
            "sensor": pl.Series([sensor] * len(nu), dtype=pl.Categorical),
            "range_m": flights.z[:, 0],
            "azimuth_deg": np.degrees(flights.z[:, 1]),
            "range_residual_m": nu[:, 0],
            "range_sd_m": sd[:, 0],
            "azimuth_residual_deg": np.degrees(nu[:, 1]),
            "azimuth_sd_deg": np.degrees(sd[:, 1]),
            "height_residual_m": nu[:, 2] if has_height else nothing,
            "height_sd_m": sd[:, 2] if has_height else nothing,
            "nis": np.where(result["dof"] > 0, result["nis"], np.nan),
            "dof": np.nan_to_num(result["dof"]).astype(int),
            "straight": pl.Series(straight).set(pl.Series(~known), None),
            "used": (result["inside"] > 0.5) | result.started,
        }
    )


def target_table(
    plots: "pl.DataFrame", found: Sorted, flights: Flights, result: Filtered
) -> "pl.DataFrame":
    """One row per track, worst first; see `TrackingResult.targets`."""
    import polars as pl
    from scipy.special import chdtri

    segments = flights.segments()
    firsts = segments[:, 0]
    used = (result["inside"] > 0.5) | result.started
    nis, dof = _sums(result["nis"], firsts), _sums(result["dof"], firsts)
    per_dof = np.divide(nis, dof, out=np.full(len(nis), np.nan), where=dof > 0)
    safe = np.maximum(dof, 1.0)
    low, high = chdtri(safe, 0.975) / safe, chdtri(safe, 0.025) / safe
    counts = segments[:, 1] - firsts
    verdict = np.select(
        [dof < 1, per_dof > high, per_dof < low],
        ["too few plots", "too confident", "too cautious"],
        default="consistent",
    )
    monitor = column(plots, "fixed_transponder", default=False).astype(bool)[found.row]
    fixed, range_sd, azimuth_sd = _fixed(flights, segments, monitor)
    table = pl.DataFrame(
        {
            "track": flights.track[firsts],
            "first_s": flights.time[firsts],
            "last_s": flights.time[segments[:, 1] - 1],
            "plots": counts,
            "used": _sums(used.astype(float), firsts).astype(int),
            "rejected": _sums((~used).astype(float), firsts).astype(int),
            "restarts": _sums(result.restarts.astype(float), firsts).astype(int),
            "nis_per_dof": per_dof,
            "nis_low": np.where(dof > 0, low, np.nan),
            "nis_high": np.where(dof > 0, high, np.nan),
            "verdict": verdict,
            "fixed": fixed,
            "range_sd_m": range_sd,
            "azimuth_sd_deg": azimuth_sd,
        }
    )
    names = [n for n in ("address", "mode_a", "aircraft_id") if n in plots.columns]
    identity = [_first_known(plots, n, found.row, segments) for n in names]
    table = table.hstack(identity).with_columns(pl.selectors.float().fill_nan(None))
    order = ["track", *names, *[c for c in table.columns if c not in ("track", *names)]]
    return table.select(order).sort("nis_per_dof", descending=True, nulls_last=True)


def _sums(values: Array, firsts: Array) -> Array:
    return np.add.reduceat(np.nan_to_num(values), firsts) if len(values) else np.zeros(0)


def _first_known(plots: "pl.DataFrame", name: str, row: Array, segments: Array) -> "pl.Series":
    import polars as pl

    values = plots[name].to_numpy()[row]
    firsts = []
    for a, b in segments.tolist():
        known = [v for v in values[a:b] if v]
        firsts.append(known[0] if known else None)
    return pl.Series(name, firsts, dtype=pl.String)


def _fixed(flights: Flights, segments: Array, monitor: Array) -> tuple[Array, Array, Array]:
    """Targets that never moved, and the scatter of their plots: the radar's noise seen bare.

    A target is fixed if the radar says so (field monitor), or if its plots stay where they are.
    """
    n = len(segments)
    fixed = np.zeros(n, dtype=bool)
    range_sd, azimuth_sd = np.full(n, np.nan), np.full(n, np.nan)
    for i, (a, b) in enumerate(segments.tolist()):
        distance, azimuth = flights.z[a:b, 0], np.degrees(np.unwrap(flights.z[a:b, 1]))
        still = np.ptp(distance) < FIXED_RANGE_M and np.ptp(azimuth) < FIXED_AZIMUTH_DEG
        if monitor[a:b].all() or (still and b - a >= FIXED_PLOTS):
            fixed[i] = True
            range_sd[i], azimuth_sd[i] = distance.std(ddof=1), azimuth.std(ddof=1)
    return fixed, range_sd, azimuth_sd


_ASSOCIATION = (
    "Plots were associated by identity only (24-bit address, else Mode A code with continuity); "
    "plots without identity are not tracked."
)


def remarks(
    flights: Flights, result: Filtered, nis: dict[str, dict[str, float]], site: Site | None
) -> list[str]:
    """What the reader must know to read the tracks right."""
    said = [_ASSOCIATION]
    if site is None:
        said.append(
            "No site was given: tracks have no latitude and longitude, and the Earth's curvature "
            "is that of a nominal place. Give --site LAT,LON,HEIGHT."
        )
    if flights.z.shape[1] == 2:
        said.append(
            "The radar measures neither elevation nor height: targets are tracked in the plane, "
            "and slant range is taken for ground range."
        )
    restarts = int(np.count_nonzero(result.restarts))
    if restarts:
        often = "Once" if restarts == 1 else f"{restarts} times"
        said.append(
            f"{often} a track rejected three plots in a row and was started anew; see the "
            "targets with restarts."
        )
    if nis["all"]["scans"] and nis["all"]["mean"] > 1.25:
        said.append(
            "Over all flight the normalised innovation squared is "
            f"{nis['all']['mean']:.2f} per degree of freedom: a constant-velocity filter cannot be "
            "consistent in turns. Judge the noise by straight flight."
        )
    return said

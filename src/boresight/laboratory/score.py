"""What is measured of one run at one scan, and what is kept of it: one formula for every contender.

Numbers and their meaning are those of `experiments.metrics`: where an estimate is no number its
error is infinite, and so is everything that is made of it; nothing is left out. Only states that
the world and the contender both have are scored, by name.

Percent fit error: kashyap, tables 2 to 6, erratum K13. OSPA and GOSPA (alpha = 2) are those of one
target and at most one track, in closed form; the parts of GOSPA are powers, which add up.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.laboratory.study import Limits, Metric
from boresight.lanes import Leaf, Scalar, Symmetric, Vector
from boresight.maths import select, wrap

Array = Any
State = Mapping[str, Any]
MEANS = ("position_sq_m2", "velocity_sq_m2ps2", "nees")  # of each run, over its scored scans
_SUMS = ("nis", "dof")


@dataclass(frozen=True)
class Score:
    """What is measured of the states that truth and estimate share.

    Attributes:
        truth, estimate: names of their states.
        metrics: that were asked for.
        limits: numbers that they need.
        metre: metres in one unit of their positions; errors of single states keep that unit.
    """

    truth: tuple[str, ...]
    estimate: tuple[str, ...]
    metrics: tuple[Metric, ...]
    limits: Limits
    metre: float = 1.0

    @property
    def names(self) -> tuple[str, ...]:
        """The states that are scored: those of the truth that the estimate has too."""
        return tuple(name for name in self.truth if name in self.estimate)

    @property
    def columns(self) -> dict[str, Leaf]:
        """What is summed over runs at every scan."""
        found = {"error": Vector(len(self.names))}
        found |= dict.fromkeys((*MEANS, "distance_m", *_SUMS, "claimed_m2"), Scalar())
        if "noncredibility" in self.metrics:
            found["error_outer"] = Symmetric(len(self.names))
        return found | dict.fromkeys(self._set_distances, Scalar())

    @property
    def layout(self) -> dict[str, Leaf]:
        """What is kept of one run from scan to scan: sums over scored scans, and what is told."""
        kept = [*MEANS, *_SUMS, *self._set_distances]
        if "percent fit error" in self.metrics:
            kept += [f"{part}_{name}" for name in self._channels for part in ("off", "all")]
        kept += ["converged_scan"] if "convergence" in self.metrics else []
        return dict.fromkeys(kept, Scalar())

    @property
    def _set_distances(self) -> tuple[str, ...]:
        parts = ("gospa_m", "gospa_localisation", "gospa_missed", "gospa_false")
        found = ("ospa_m",) if "ospa" in self.metrics else ()
        return (*found, *parts) if "gospa" in self.metrics else found

    @property
    def _channels(self) -> tuple[str, ...]:
        if len(self._places("x_", "y_", "z_")) == 3:
            return ("range", "azimuth", "elevation", "x", "y", "z")
        return ("range", "azimuth", "x", "y")

    def _places(self, *starts: str) -> list[int]:
        """Where among the scored states those are whose names begin so."""
        return [i for i, name in enumerate(self.names) if name.startswith(starts)]

    def measure(self, truth: Array, told: Mapping[str, Any]) -> dict[str, Any]:
        """Every column of one run at one scan.

        Args:
            truth: state of the target, in the order of `truth`.
            told: the filter's `mean`, `cov`, `nis` and `dof`.

        Returns:
            `columns`, and `true` and `found`, the positions.
        """
        of = [self.truth.index(name) for name in self.names]
        at = [self.estimate.index(name) for name in self.names]
        mean, cov = told["mean"][at], told["cov"][np.ix_(at, at)]
        error = np.array([_or_infinite(x) for x in mean - truth[of]])
        position, velocity = self._places("x_", "y_", "z_"), self._places("vx_", "vy_", "vz_")
        normalised, positive = _normalised_square(error, cov)
        area = self.metre * self.metre
        claimed = area * sum(cov[i, i] for i in position)
        square = area * sum(error[i] * error[i] for i in position)
        columns = {
            "error": error,
            "position_sq_m2": square,
            "distance_m": np.sqrt(square),
            "velocity_sq_m2ps2": sum(error[i] * error[i] for i in velocity) if velocity else np.nan,
            "nees": select(positive, _or_infinite(normalised / len(error)), np.inf),
            "nis": _or_infinite(told["nis"]),
            "dof": told["dof"],
            "claimed_m2": select(positive, _or_infinite(claimed), np.inf),
            "error_outer": np.outer(error, error),
            "true": truth[of][position],
            "found": mean[position],
        }
        return columns | self._as_sets(columns["distance_m"], columns["claimed_m2"])

    def _as_sets(self, distance: Any, claimed: Any) -> dict[str, Any]:
        """OSPA and GOSPA of the target and the one track, or none where it is lost."""
        cutoff, p = self.limits.cutoff_m, self.limits.order
        half = cutoff**p / 2.0
        shown = (distance < np.inf) & (claimed <= self.limits.lost_m**2)
        near = select(distance < cutoff, distance, cutoff)
        is_pair = shown & (distance < cutoff)
        return {
            "ospa_m": select(shown, near, cutoff),
            "gospa_m": select(shown, near, half ** (1.0 / p)),
            "gospa_localisation": select(is_pair, _power(near, p), 0.0),
            "gospa_missed": select(is_pair, 0.0, half),
            "gospa_false": select(shown & (distance >= cutoff), half, 0.0),
        }

    def keep(self, kept: State, columns: Mapping[str, Any], scan: Any, scored: Any) -> State:
        """What is kept of the run after another scan.

        Args:
            kept: what was kept before it, by the names of `layout`.
            columns: from `measure`.
            scan: its number, from 0.
            scored: 1, or 0 for a scan that is not.
        """
        addends = dict(columns)
        if "percent fit error" in self.metrics:
            addends |= self._fit(columns["true"], columns["found"])
        new = {
            name: kept[name] + select(scored > 0.5, addends[name], 0.0)
            for name in self.layout
            if name != "converged_scan"
        }
        if "convergence" in self.metrics:
            stays = columns["distance_m"] < self.limits.converged_m
            new["converged_scan"] = select(stays, kept["converged_scan"], scan + 1.0)
        return new

    def _fit(self, true: Array, found: Array) -> dict[str, Any]:
        """Squares of each channel's error and of the channel itself."""
        squares: dict[str, Any] = {}
        pairs = zip(self._channels, _polar(true), _polar(found), strict=True)
        for name, channel, estimate in pairs:
            off = estimate - channel
            off = wrap(off) if name in ("azimuth", "elevation") else off
            squares |= {f"off_{name}": _or_infinite(off * off), f"all_{name}": channel * channel}
        return squares

    def of_runs(self, kept: Mapping[str, Array], final_m: Array, scored: int) -> dict[str, Array]:
        """Numbers of each run (runs,), from what was kept of it over `scored` scans."""
        means = {name: kept[name] / scored for name in (*MEANS, *self._set_distances)}
        found = means | {name: kept[name] for name in _SUMS} | {"final_m": final_m}
        if "percent fit error" in self.metrics:
            for name in self._channels:
                with np.errstate(divide="ignore", invalid="ignore"):
                    share = np.sqrt(kept[f"off_{name}"] / kept[f"all_{name}"])
                found[f"fit_error_{name}"] = np.where(np.isfinite(share), 100.0 * share, np.inf)
        if "convergence" in self.metrics:
            found["converged_scan"] = kept["converged_scan"]
        return found


def _or_infinite(x: Any) -> Any:
    return select(abs(x) < np.inf, x, np.inf)


def _normalised_square(error: Array, cov: Array) -> tuple[Any, Any]:
    """The error's square over P, e' P^-1 e, and whether P is positive definite; without a root."""
    n, rest, total, positive = len(error), list(error), 0.0, None
    rows = [[cov[i, j] for j in range(n)] for i in range(n)]
    for k in range(n):
        inverse = 1.0 / rows[k][k]
        total = total + rest[k] * rest[k] * inverse
        is_positive = rows[k][k] > 0.0
        positive = is_positive if positive is None else positive & is_positive
        for i in range(k + 1, n):
            factor = rows[k][i] * inverse
            rest[i] = rest[i] - factor * rest[k]
            for j in range(i, n):
                rows[i][j] = rows[i][j] - factor * rows[k][j]
    return total, positive


def _polar(p: Array) -> list[Any]:
    """Channels of a position, as `metrics.channels` has them, in the order of `_channels`."""
    ground = sum(x * x for x in p[:2])
    angles = [np.arctan2(p[1], p[0])]
    if len(p) == 3:
        angles.append(np.arctan2(p[2], np.sqrt(ground)))
    return [np.sqrt(sum(x * x for x in p)), *angles, *p]


def _power(x: Any, p: float) -> Any:
    """A length to the power p >= 1."""
    if float(p).is_integer():
        return x ** int(p)
    return select(x > 0.0, np.exp(p * np.log(select(x > 0.0, x, 1.0))), 0.0)

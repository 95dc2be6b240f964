"""How good an estimate is, and whether it knows: errors, NEES, NIS, percent fit error.

No run is ever dropped: where a filter's state is not a number its error is infinite, and so is
every average it belongs to. `scans` is a slice, so `scans=slice(20, None)` leaves out the start.

[barshalom2001] Y. Bar-Shalom, X. R. Li and T. Kirubarajan, "Estimation with Applications to
Tracking and Navigation", section 5.4. Percent fit error: kashyap, tables 2 to 6, erratum K13.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.simulate import Truth
from boresight.filters.recursion import Estimate
from boresight.lanes import Kernel, Rate, Scalar, Symmetric, Vector, make_kernel, pack_states, trace
from boresight.maths import cholesky, lower_solve, wrap

Array = Any
ALL = slice(None)
FALSE_ALARM = 0.05
DIVERGED = 100.0  # NEES per state: errors ten times what the filter claims


class Consistency(NamedTuple):
    """A normalised squared error per degree of freedom: 1 for a filter that knows its errors.

    Attributes:
        value: the average over runs and scans.
        low, high: where the average over the runs at one scan lies with a probability of 95 %
            (or as asked) if the filter is consistent; exact. Errors at neighbouring scans are
            alike, so an average over scans lies inside more often than that.
        standard_error: of `value`, from how much it differs between runs.
    """

    value: float
    low: float
    high: float
    standard_error: float


def errors(estimate: Estimate, truth: Truth) -> Array:
    """Estimate minus truth, (runs, scans, n); infinite where the estimate is not a number."""
    mean = _output(estimate, "mean")
    if mean.shape != truth.states.shape:
        raise UsageError(f"the estimate is {mean.shape} and the truth {truth.states.shape}")
    difference = mean - truth.states
    return np.where(np.isfinite(difference), difference, np.inf)


def _output(estimate: Estimate, name: str) -> Array:
    try:
        return getattr(estimate, name)
    except AttributeError:
        raise UsageError(
            f"the estimate has no {name!r}", next_step=f"run the filter with {name!r} in outputs"
        ) from None


def elements(names: tuple[str, ...], of: str) -> list[int]:
    """Which elements of the state are meant.

    Args:
        names: of the state's elements, with units.
        of: `position`, `velocity`, or one of the names.
    """
    kinds = {"position": ("x_", "y_", "z_"), "velocity": ("vx_", "vy_", "vz_")}
    found = [i for i, name in enumerate(names) if name == of or name.startswith(kinds.get(of, of))]
    if not found:
        raise UsageError(
            f"the state has no {of!r}", next_step=f"use position, velocity or {', '.join(names)}"
        )
    return found


def squared_error(estimate: Estimate, truth: Truth, of: str = "position") -> Array:
    """Squared distance from the truth, (runs, scans)."""
    error = errors(estimate, truth)[..., elements(truth.names, of)]
    return np.sum(np.square(error), axis=-1)


def rmse(estimate: Estimate, truth: Truth, *, of: str = "position", scans: slice = ALL) -> float:
    """Root mean square error over runs and scans.

    Args:
        estimate: with `mean`.
        truth: what was estimated.
        of: `position` (distance, in the state's unit), `velocity`, or the name of one element.
        scans: which scans.
    """
    return float(np.sqrt(np.mean(squared_error(estimate, truth, of)[:, scans])))


def rmse_per_scan(estimate: Estimate, truth: Truth, *, of: str = "position") -> Array:
    """Root mean square error over runs, (scans,)."""
    return np.sqrt(np.mean(squared_error(estimate, truth, of), axis=0))


def rmse_per_run(
    estimate: Estimate, truth: Truth, *, of: str = "position", scans: slice = ALL
) -> Array:
    """Root mean square error over scans, (runs,)."""
    return np.sqrt(np.mean(squared_error(estimate, truth, of)[:, scans], axis=1))


def nees(estimate: Estimate, truth: Truth) -> Array:
    """Normalised estimation error squared e' P^-1 e, (runs, scans), n degrees of freedom.

    Infinite where P is not positive definite.
    """
    return normalised(errors(estimate, truth), _output(estimate, "cov"))


def normalised(error: Array, cov: Array) -> Array:
    """Quadratic forms e' P^-1 e of errors (runs, scans, n), covariances (runs, scans, n, n)."""
    runs, scans, n = error.shape
    kernel = _nees_kernel(n)
    none = pack_states(kernel.program.state, {"unused": np.zeros(runs)})
    values = {"error": error, "cov": cov}
    with np.errstate(all="ignore"):
        square = kernel.run(none, values, scans)[1]["nees"]
    return np.where(np.isfinite(square), square, np.inf)


@lru_cache(maxsize=32)
def _nees_kernel(n: int) -> Kernel:
    def step(state: Any, inputs: Any) -> tuple[Any, Any]:
        L, inverse = cholesky(inputs["cov"])
        white = lower_solve(L, inverse, inputs["error"])
        return state, {"nees": white @ white}

    return make_kernel(
        trace(
            step,
            state={"unused": Scalar()},
            inputs={"error": (Vector(n), Rate.EACH), "cov": (Symmetric(n), Rate.EACH)},
            outputs={"nees": (Scalar(), Rate.EACH)},
        )
    )


def anees(
    estimate: Estimate, truth: Truth, *, scans: slice = ALL, false_alarm: float = FALSE_ALARM
) -> Consistency:
    """Average NEES per state: above 1 the filter is too sure of itself, below 1 too modest.

    Args:
        estimate: with `mean` and `cov`.
        truth: what was estimated.
        scans: which scans.
        false_alarm: probability with which a consistent filter leaves the bounds at one scan.
    """
    return _consistency(nees(estimate, truth)[:, scans], truth.states.shape[2], false_alarm)


def anis(
    estimate: Estimate, *, scans: slice = ALL, false_alarm: float = FALSE_ALARM
) -> Consistency:
    """Average NIS per measured component: what can be tested without knowing the truth.

    Args:
        estimate: with `nis` and `dof`; scans without a plot count for nothing.
        scans: which scans.
        false_alarm: as in `anees`. Innovations of different scans are independent, so here the
            bounds are those of the average over runs and scans.
    """
    square, dof = (_output(estimate, name)[:, scans] for name in ("nis", "dof"))
    square = np.where(np.isfinite(square), square, np.inf)
    total = float(np.sum(dof))
    low, high = chi_square_bounds(total, false_alarm)
    share = np.sum(square, axis=1) / (total / len(square))
    return Consistency(float(np.sum(square)) / total, low, high, _standard_error(share))


def anees_per_scan(estimate: Estimate, truth: Truth) -> Array:
    """Average NEES per state over runs, (scans,); its bounds are those of `anees`."""
    return np.mean(nees(estimate, truth), axis=0) / truth.states.shape[2]


def _consistency(squares: Array, dof: int, false_alarm: float) -> Consistency:
    """Of normalised squares (runs, scans) with `dof` degrees of freedom each."""
    runs = np.mean(squares, axis=1) / dof
    low, high = chi_square_bounds(len(squares) * dof, false_alarm)
    return Consistency(float(np.mean(runs)), low, high, _standard_error(runs))


def _standard_error(runs: Array) -> float:
    if len(runs) < 2 or not np.all(np.isfinite(runs)):
        return float("inf")
    return float(np.std(runs, ddof=1) / np.sqrt(len(runs)))


def chi_square_bounds(dof: float, false_alarm: float = FALSE_ALARM) -> tuple[float, float]:
    """Two-sided bounds of a chi-square variable divided by its degrees of freedom."""
    from scipy.special import chdtri

    half = false_alarm / 2
    return float(chdtri(dof, 1 - half)) / dof, float(chdtri(dof, half)) / dof


def diverged(estimate: Estimate, truth: Truth, *, scans: slice = ALL) -> float:
    """Share of runs whose errors are ten times what the filter claims, or not numbers."""
    runs = np.mean(nees(estimate, truth)[:, scans], axis=1) / truth.states.shape[2]
    return float(np.mean(~(runs < DIVERGED)))


def percent_fit_error(estimate: Estimate, truth: Truth, *, scans: slice = ALL) -> dict[str, Array]:
    """Percent fit error of each run and channel: 100 |true - estimate| / |true| over the run.

    Paper: kashyap, tables 2 to 6; the formula is ours (erratum K13). Differences of angles are
    wrapped; angles in the denominator lie in (-pi, pi]. Positions are relative to the sensor.

    Returns:
        By channel, (runs,): `range`, `azimuth`, `elevation` (in three dimensions), `x`, `y`, `z`.
    """
    at = elements(truth.names, "position")
    true = channels(truth.states[:, scans, at])
    found = channels(estimate.mean[:, scans, at])
    result = {}
    for name, channel in true.items():
        difference = found[name] - channel
        if name in ("azimuth", "elevation"):
            difference = wrap(difference)
        share = np.linalg.norm(difference, axis=1) / np.linalg.norm(channel, axis=1)
        result[name] = np.where(np.isfinite(share), 100 * share, np.inf)
    return result


def channels(position: Array) -> dict[str, Array]:
    """Polar and Cartesian channels of positions (..., 2 or 3), angles counted from the x axis."""
    ground = np.hypot(position[..., 0], position[..., 1])
    result = {"range": np.linalg.norm(position, axis=-1)}
    result["azimuth"] = np.arctan2(position[..., 1], position[..., 0])
    if position.shape[-1] == 3:
        result["elevation"] = np.arctan2(position[..., 2], ground)
    return result | {axis: position[..., i] for i, axis in enumerate("xyz"[: position.shape[-1]])}

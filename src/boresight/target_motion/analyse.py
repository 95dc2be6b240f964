"""Target motion analysis of one contact: filter, observability, convergence, residuals.

[pradeep], as corrected by errata P1 to P10; [nardone1984] for what bearings alone can tell.
"""

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import UsageError
from boresight.filters.batch import BatchEstimate, batch_map, velocity_prior
from boresight.filters.fisher import fisher_information, polar_bound
from boresight.filters.method import Filter
from boresight.maths import Gaussian
from boresight.mixtures.bank import Bank, run_bank
from boresight.mixtures.range_parameterised import SPEED_MPS, RangeParameterised
from boresight.models.checks import not_negative, positive
from boresight.models.motion import ConstantVelocity
from boresight.target_motion.contact import Contact
from boresight.target_motion.convergence import check_criteria, converge
from boresight.target_motion.doubts import (
    of_difference,
    of_limits,
    of_residuals,
    of_spread,
)
from boresight.target_motion.observability import observe
from boresight.target_motion.quantities import QUANTITIES, as_polar, describe, history
from boresight.target_motion.residuals import judge
from boresight.target_motion.result import (
    Batch,
    Cells,
    Criteria,
    Observability,
    Quantity,
    Residuals,
    TargetMotion,
)

if TYPE_CHECKING:
    import polars as pl

Array = Any
BANKS = ("rp-ekf", "rp-mgekf", "rp-ukf", "rp-ckf", "rp-modified-polar")
_SDS = ("range_sd_m", "bearing_sd_deg", "course_sd_deg", "speed_sd_mps")
_BOUNDS = ("range_bound_m", "bearing_bound_deg", "course_bound_deg", "speed_bound_mps")
FASTEST_MPS = 10_000.0  # of what may be believed: no contact is faster
MOTION = ConstantVelocity(accel_mps2=0.0, dims=2)
_DEGREES = np.array([1.0, 180.0 / np.pi, 180.0 / np.pi, 1.0])  # of polar columns in radians


@dataclass(frozen=True, kw_only=True)
class Belief:
    """What is believed of a contact before it is heard.

    Attributes:
        nearest_m, farthest_m: between which ranges it is.
        speed_mps: standard deviation of each component of its velocity.
        accel_mps2: standard deviation of its acceleration; 0 for a steady course and speed, which
            the bound and the batch estimate take for granted.
        position_sd_m: how well own ship's track is known; what wanders by it is no manoeuvre.
    """

    nearest_m: float = RangeParameterised.nearest_m
    farthest_m: float = RangeParameterised.farthest_m
    speed_mps: float = SPEED_MPS
    accel_mps2: float = 0.0
    position_sd_m: float = 5.0

    def __post_init__(self) -> None:
        """Numbers are checked."""
        if positive("speed_mps", self.speed_mps) > FASTEST_MPS:
            raise UsageError(f"speed_mps={self.speed_mps:g} is above {FASTEST_MPS:,.0f} m/s")
        not_negative("accel_mps2", self.accel_mps2)
        positive("position_sd_m", self.position_sd_m)
        RangeParameterised(nearest_m=self.nearest_m, farthest_m=self.farthest_m)

    @property
    def spread(self) -> "RangeParameterised":
        """The bank that spans these ranges: for what all its cells have in common."""
        return RangeParameterised(nearest_m=self.nearest_m, farthest_m=self.farthest_m)


def analyse(
    contact: Contact,
    chosen: Filter,
    *,
    belief: Belief | None = None,
    criteria: Criteria | None = None,
) -> TargetMotion:
    """Range, bearing, course and speed of one contact, and how far they can be trusted.

    Args:
        contact: what was heard.
        chosen: a bank, or any filter that takes bearings; a bank's own limits of range hold.
        belief: what is known before.
        criteria: when the answer is good enough.

    Raises:
        UsageError: a filter that does not take bearings, or cannot part the sides of a cone.
    """
    belief, criteria = belief or Belief(), criteria or Criteria()
    check_criteria(criteria)
    method = chosen.method
    _check_sides(contact, chosen)
    spread = method if isinstance(method, RangeParameterised) else belief.spread
    bank = _filtered(contact, method, spread, belief)
    seen = observe(contact, bank, position_sd_m=belief.position_sd_m)
    answer = describe(bank, contact, observable=seen.observable)
    fit = _fit(contact, bank, spread, belief)
    track = _track(contact, answer.mean if answer.decided else fit.mean[0])
    bound = _bound(contact, track, spread, belief)
    past, residuals = history(bank, contact), _judged(contact, fit)
    is_known = _known(contact, seen)
    estimate, sd = (np.stack([past[n] for n in names], axis=-1) for names in (QUANTITIES, _SDS))
    met = converge(estimate, sd, is_known, bound, criteria, contact.time_s)
    batch = _batch(contact, fit) if fit.converged[0] and seen.observable else None
    against = (
        *of_spread(past["range_sd_m"][-1], bound[-1, 0]),
        *of_limits(answer.range_m, spread),
        *(() if belief.accel_mps2 else of_difference(answer.range_m, batch)),
    )
    heard = int(np.isfinite(contact.plots).any(-1).sum())
    return TargetMotion(
        contact=contact,
        filter=chosen.name,
        bearings=heard,
        criteria=criteria,
        observability=seen,
        # What contradicts itself has not converged, however small it says its errors are.
        convergence=replace(met, sustained_s=None) if against else met,
        **{name: getattr(answer, name) for name in QUANTITIES},
        mean=answer.mean,
        cov=answer.cov,
        sides=answer.sides,
        decided=answer.decided,
        history=_table(contact, past, bound, is_known),
        cells=_cells(bank, spread if isinstance(method, RangeParameterised) else None),
        batch=batch,
        residuals=residuals,
        settings=_settings(chosen, spread, belief),
        remarks=(*against, *of_residuals(residuals, heard)),
    )


def _check_sides(contact: Contact, chosen: Filter) -> None:
    """Refuse a filter that follows one side of an array, where it hears two."""
    if contact.is_conical and not isinstance(chosen.method, RangeParameterised):
        raise UsageError(
            f"{chosen.name} follows one side of the array's axis",
            why=f"the bearings of {contact.name} are cones, which have two",
            next_step=f"use rp-{chosen.name}" if f"rp-{chosen.name}" in BANKS else "use rp-ekf",
        )


def _filtered(contact: Contact, method: Any, spread: RangeParameterised, belief: Belief) -> Bank:
    """Every cell of the bank; the first bearing makes the start and is not used again."""
    z = contact.plots.copy()
    start = spread.start(z[:, 0], MOTION, contact.sensor, speed_mps=belief.speed_mps)
    z[:, 0] = np.nan
    first = Gaussian(start.mean[0], start.cov[0])
    motion = ConstantVelocity(accel_mps2=belief.accel_mps2, dims=2)
    return run_bank(method, motion, contact.sensor, z, contact.dt, first)


def _fit(contact: Contact, bank: Bank, spread: RangeParameterised, belief: Belief) -> BatchEstimate:
    """The batch estimate, from where every cell ended, on the side that is the heavier."""
    means, side = bank.means[-1], bank.side
    heavier = side == max(np.unique(side), key=lambda s: bank.weights[-1, side == s].sum())
    starts = means[heavier & np.isfinite(means).all(-1)]
    middle, sd = _range_spread(spread)
    return batch_map(
        contact.plots,
        MOTION,
        contact.sensor,
        contact.dt,
        prior=velocity_prior(MOTION, belief.speed_mps)._replace(range_m=middle, range_sd_m=sd),
        starts=starts[None],
    )


def _range_spread(spread: RangeParameterised) -> tuple[float, float]:
    """Mean and standard deviation of the range over all cells, m."""
    middles, widths = spread.ranges
    middle = float(np.mean(middles))
    return middle, float(np.sqrt(np.mean(widths**2 + (middles - middle) ** 2)))


def _bound(contact: Contact, track: Array, spread: RangeParameterised, belief: Belief) -> Array:
    """(steps, 4) Cramér-Rao bound of the polar columns, with what was believed before.

    Taken along the estimated track (steps, 4): the truth is not known.
    """
    away = track[0, :2] - contact.position_m[0]
    along = away / max(float(np.hypot(*away)), 1.0)
    prior = velocity_prior(MOTION, belief.speed_mps).information
    prior[:2, :2] = np.outer(along, along) / _range_spread(spread)[1] ** 2
    heard = np.isfinite(contact.plots)
    known = fisher_information(track[None], MOTION, contact.sensor, contact.dt, heard, prior=prior)
    return polar_bound(known[0], track, contact.position_m) * _DEGREES


def _track(contact: Contact, last: Array) -> Array:
    """(steps, 4): a straight track that ends in this state."""
    back = (contact.time_s - contact.time_s[-1])[:, None]
    velocity = np.broadcast_to(last[2:], (len(back), 2))
    return np.hstack([last[:2] + back * velocity, velocity])


def _known(contact: Contact, seen: Observability) -> Array:
    """(steps,) whether bearings alone told the range by then, and ever after."""
    since = np.inf if seen.since_s is None else seen.since_s
    return contact.time_s >= since


def _table(
    contact: Contact, past: dict[str, Array], bound: Array, is_known: Array
) -> "pl.DataFrame":
    """A row for each bearing; see `TargetMotion`."""
    import polars as pl

    heard = np.where(np.isnan(contact.bearing_rad), contact.cone_rad, contact.bearing_rad)
    columns = {
        "time_s": contact.time_s,
        "own_north_m": contact.position_m[:, 0],
        "own_east_m": contact.position_m[:, 1],
        "heard_deg": np.degrees(heard) % 360.0,
        "is_cone": np.isfinite(contact.cone_rad),
        **past,
        **dict(zip(_BOUNDS, bound.T, strict=True)),
        "observable": is_known,
    }
    return pl.DataFrame(columns)


def _cells(bank: Bank, spread: RangeParameterised | None) -> Cells:
    """The bank's cells; a single filter has one, of no range of its own."""
    sides = len(np.unique(bank.side))
    ranges = np.repeat(spread.ranges[0], sides) if spread else np.full(1, np.nan)
    return Cells(range_m=ranges, side=bank.side, weights=bank.weights, mean=bank.means[-1, :, :4])


def _batch(contact: Contact, fit: BatchEstimate) -> Batch:
    """The batch estimate, to read."""
    mean, here = fit.mean[0], contact.position_m[-1]
    sd = polar_bound(fit.information[0], mean, here) * _DEGREES
    said = {
        name: Quantity(estimate=float(value), sd=float(spread))
        for name, value, spread in zip(QUANTITIES, as_polar(mean, here), sd, strict=True)
    }
    return Batch(mean=mean, cov=fit.cov[0], cost=float(fit.cost[0]), converged=True, **said)


def _judged(contact: Contact, fit: BatchEstimate) -> Residuals | None:
    """What is left of the bearings, if the fit settled and there are more of them than unknowns."""
    enough = np.isfinite(contact.plots).sum() > len(MOTION.names)
    return judge(contact, fit) if fit.converged[0] and enough else None


def _settings(chosen: Filter, spread: RangeParameterised, belief: Belief) -> dict[str, Any]:
    """Everything that was chosen."""
    limits = {"nearest_m": spread.nearest_m, "farthest_m": spread.farthest_m}
    bank = asdict(spread) if chosen.name in BANKS else limits
    return {"filter": chosen.name, **asdict(belief), **bank}

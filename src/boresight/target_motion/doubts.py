"""What contradicts itself in an answer, and what the residuals say against it, in sentences."""

from typing import TYPE_CHECKING

from boresight.maths.digits import rounded

if TYPE_CHECKING:
    from boresight.mixtures.range_parameterised import RangeParameterised
    from boresight.target_motion.result import Batch, Quantity, Residuals

TOO_SURE = 0.5  # of the bound: a smaller sd is a fault, not luck
UNKNOWNS = 4  # of a steady track
APART = 3.0  # standard deviations between filter and batch estimate: more is no chance


def of_residuals(residuals: "Residuals | None", bearings: int) -> tuple[str, ...]:
    """What the failed tests say: first the one that others may follow from, then what stands alone.

    Those that follow are only named.
    """
    if residuals is None and bearings <= UNKNOWNS:
        return (f"{bearings} bearings fit a steady track whatever it is: nothing is left to test.",)
    if residuals is None:
        return ("No steady track fits the bearings well enough for a batch estimate to settle.",)
    failed = [test for test in residuals.tests if not test.passed]
    names = {test.follows for test in failed}
    alone = sorted(
        (test for test in failed if not test.follows), key=lambda test: test.name not in names
    )
    said = [test.words for test in alone]
    following = [test.name for test in failed if test.follows]
    if following:
        said[0] += f" That would also explain what is found of: {', '.join(following)}."
    return tuple(said)


def of_spread(sd_m: float, bound_m: float) -> tuple[str, ...]:
    """What is wrong with a range that is said to be known better than it can be."""
    if not is_too_sure(sd_m, bound_m):
        return ()
    words = (
        f"The filter is too sure of itself: it states the range to an sd of {rounded(sd_m)} m, "
        f"and no method could have it below {rounded(bound_m)} m (the Cramér-Rao bound with the "
        "same belief). Its regions are too narrow."
    )
    return (words,)


def of_difference(range_m: "Quantity", batch: "Batch | None") -> tuple[str, ...]:
    """What is wrong with a range that the batch estimate does not share."""
    if batch is None or range_m.estimate is None or range_m.sd is None:
        return ()
    other, sd = batch.range_m.estimate, batch.range_m.sd
    if other is None or sd is None:
        return ()
    apart = abs(range_m.estimate - other) / max(range_m.sd, sd)
    if apart <= APART:
        return ()
    words = (
        f"The filter has lost the contact: its range is {apart:.1f} standard deviations from the "
        f"batch estimate's {other:,.0f} ± {rounded(sd)} m, which has all bearings at once."
    )
    return (words,)


def is_too_sure(sd_m: float, bound_m: float) -> bool:
    """Whether a filter states less than the bearings and the belief can have told it."""
    return sd_m < TOO_SURE * bound_m


def of_limits(range_m: "Quantity", spread: "RangeParameterised") -> tuple[str, ...]:
    """What is wrong with a range that was not believed possible."""
    region = range_m.regions.get("90", ())
    if not region or (region[-1][1] >= spread.nearest_m and region[0][0] <= spread.farthest_m):
        return ()
    words = (
        f"The range comes out at {region[0][0]:,.0f} to {region[-1][1]:,.0f} m, outside the "
        f"{spread.nearest_m:,.0f} to {spread.farthest_m:,.0f} m that were believed possible: "
        "either these limits are wrong, or the contact does not keep its course and speed "
        "(own ship's own noise, for one, turns with it)."
    )
    return (words,)

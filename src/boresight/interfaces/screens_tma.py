"""What a person sees of target motion analysis in the terminal."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from boresight.interfaces.report.words import figure
from boresight.interfaces.screens import table, text, written
from boresight.maths.digits import decimals, with_unit

if TYPE_CHECKING:
    from rich.console import RenderableType

    from boresight.target_motion.result import Quantity, Region, Side, TargetMotion, TmaResult

ROWS = (
    ("range", "range_m", "m"),
    ("bearing", "bearing_deg", "°"),
    ("course", "course_deg", "°"),
    ("speed", "speed_mps", "m/s"),
)
FULL = 3  # contacts that are each shown in full; more are shown in one table


def analysed(found: "TmaResult", outputs: Sequence[str], width: int) -> "list[RenderableType]":
    """The screen of `boresight tma`."""
    del width
    many = len(found.contacts) > FULL
    if many:
        return [_overview(found), *written(outputs)]
    first, *others = (_contact(each) for each in found.contacts)
    parts = [*first, *(part for each in others for part in (text(""), *each))]
    return [*parts, *written(outputs)]


def _contact(one: "TargetMotion") -> "list[RenderableType]":
    span = one.contact.time_s[-1] - one.contact.time_s[0]
    head = (
        f"{one.contact.name}: {figure(one.bearings)} bearings over {_lasting(span)}, {one.filter}"
    )
    parts = [text(head, "bold"), text(_known(one), "" if one.observable else "yellow"), text("")]
    if one.sides and not one.decided:
        return [*parts, *(_grid(_chance(side), side) for side in one.sides), _when(one)]
    return [*parts, _grid("At the last bearing", one), _when(one)]


def _chance(side: "Side") -> str:
    return f"If it is to {side.name} (probability {side.probability:.2f})"


def _grid(heading: str, one: "TargetMotion | Side") -> "RenderableType":
    grid = table(heading, "", "estimate", "sd", "50 % region", "90 % region", "99 % region")
    for words, name, unit in ROWS:
        quantity = getattr(one, name)
        regions = [_region(quantity, level, unit) for level in ("50", "90", "99")]
        grid.add_row(words, *_figures(quantity, unit), *regions)
    for column in grid.columns[3:]:
        column.no_wrap = False  # a region in pieces
    return grid


def _figures(quantity: "Quantity", unit: str) -> tuple[str, str]:
    if quantity.estimate is None or quantity.sd is None:
        return "not known", "–"
    digits = decimals(quantity.sd)
    return with_unit(quantity.estimate, digits, unit).lstrip("+"), f"{quantity.sd:,.{digits}f}"


def _region(quantity: "Quantity", level: str, unit: str) -> str:
    """The intervals of a region: `3,400 to 4,100`, in pieces where it is; `350 to 10` over North.

    Pieces that touch in the digits shown are one.
    """
    pieces = quantity.regions.get(level, ())
    if not pieces:
        return "–"
    digits = decimals(sum(high - low for low, high in pieces) / 8.0)
    joined = [pieces[0]]
    for low, high in pieces[1:]:
        if round(low, digits) <= round(joined[-1][1], digits):
            joined[-1] = (joined[-1][0], high)
        else:
            joined.append((low, high))
    turn = 360.0 if unit == "°" and joined[-1][1] - joined[0][0] < 360.0 else float("inf")
    ends = ([f"{round(end, digits) % turn:,.{digits}f}" for end in pair] for pair in joined)
    return ", ".join(f"{low} to {high}" for low, high in ends)


def _known(one: "TargetMotion") -> str:
    """What is known, in one sentence."""
    seen = one.observability
    if one.observable:
        since = "" if seen.since_s is None else f" since {figure(seen.since_s)} s"
        return f"Bearings alone tell the range{since}, to ±{figure(seen.range_sd_m, 2)} m (bound)."
    if not seen.manoeuvred:
        return "The range cannot be told: own ship has not manoeuvred since the first bearing."
    if seen.at_best_percent < float("inf"):
        best = f"{figure(seen.at_best_percent, 2)} %"
        return f"The range cannot be told yet: own ship's course tells it to ±{best} at best."
    return "The range cannot be told yet."


def _when(one: "TargetMotion") -> "RenderableType":
    """When the criteria were met."""
    when, limits = one.convergence, one.criteria
    asked = (
        f"range ±{limits.range_percent:g} %, bearing ±{limits.bearing_deg:g}°, course "
        f"±{limits.course_deg:g}°, speed ±{limits.speed_mps:.2f} m/s, {limits.confidence:.0%} sure"
    )
    permitted = (
        f"the Cramér-Rao bound along this track meets it from {figure(when.permitted_s)} s"
        if when.permitted_s is not None
        else "the Cramér-Rao bound along this track does not meet it"
    )
    if when.sustained_s is None:
        return text(f"Not converged ({asked}); {permitted}.", "yellow")
    return text(f"Converged at {figure(when.sustained_s)} s ({asked}); {permitted}.")


def _overview(found: "TmaResult") -> "RenderableType":
    heading = f"{len(found.contacts)} contacts"
    grid = table(
        heading, "contact", "bearings", "from", "lasting", "bearing", "range", "90 % region, km"
    )
    for one in found.contacts:
        first, last = one.contact.time_s[0], one.contact.time_s[-1]
        grid.add_row(
            one.contact.name,
            figure(one.bearings),
            f"{first:,.0f} s",
            _lasting(last - first),
            _either(one),
            _short(one.range_m, "m"),
            _kilometres(one.range_m.regions.get("90", ())),
        )
    return grid


def _kilometres(region: "Region") -> str:
    return ", ".join(f"{low / 1e3:.2f}–{high / 1e3:.2f}" for low, high in region) or "–"


def _short(quantity: "Quantity", unit: str) -> str:
    if quantity.estimate is None or quantity.sd is None:
        return "not known"
    digits = decimals(quantity.sd)
    return f"{quantity.estimate:,.{digits}f} ± {quantity.sd:,.{digits}f} {unit}"


def _either(one: "TargetMotion") -> str:
    """The bearing, or both of them."""
    if not one.sides or one.decided:
        return _short(one.bearing_deg, "°")
    return " or ".join(figure(side.bearing_deg.estimate, 3) + "°" for side in one.sides)


def _lasting(seconds: float) -> str:
    """A duration: `13 min 20 s`, `24 h 0 min`."""
    minutes, rest = divmod(round(seconds), 60)
    if minutes >= 120:
        return f"{minutes // 60} h {minutes % 60} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"

"""What target motion analysis answers. Angles in degrees true, clockwise from North."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from boresight.target_motion.contact import Contact

if TYPE_CHECKING:
    import polars as pl

Array = Any
Region = tuple[tuple[float, float], ...]
LEVELS = (50, 90, 99)  # of credible regions, per cent


@dataclass(frozen=True, kw_only=True)
class Criteria:
    """When an answer is good enough: pradeep section 3, "error that is tolerated".

    Attributes:
        range_percent, bearing_deg, course_deg, speed_mps: how far off each may be. The paper's
            2 knots are 1.03 m/s (erratum P10).
        confidence: how sure one must be that each is within its limit.
    """

    range_percent: float = 10.0
    bearing_deg: float = 0.5
    course_deg: float = 5.0
    speed_mps: float = 2.0 * 1852.0 / 3600.0
    confidence: float = 0.9


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """One number of the answer.

    Attributes:
        estimate, sd: mean and standard deviation; None where nothing can be said.
        regions: credible regions by level in per cent, "50", "90", "99": the shortest set of
            intervals that holds so much, in pieces where it must be. Those of an angle may run
            past 360, never backwards.
    """

    estimate: float | None
    sd: float | None
    regions: dict[str, Region] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Side:
    """One side of the array, as far as it is still possible.

    Attributes:
        name: `port` or `starboard`.
        probability: of the contact being there.
        range_m, bearing_deg, course_deg, speed_mps: if it is.
    """

    name: str
    probability: float
    range_m: Quantity
    bearing_deg: Quantity
    course_deg: Quantity
    speed_mps: Quantity


@dataclass(frozen=True, kw_only=True)
class Observability:
    """What the bearings alone tell of the range, whatever was believed before.

    Attributes:
        observable: whether they tell it well enough for a point estimate.
        since_s: from when on they do; None if they do not.
        range_sd_m: Cramér-Rao bound of the range from bearings alone; infinite where the
            information is singular.
        at_best_percent: the smallest such bound, in per cent of the range, for any target that
            own ship's course so far could have heard on these bearings.
        manoeuvred: whether own ship's course tells of the range at all.
        by_step: (steps,) the bound in m after each bearing.
    """

    observable: bool
    since_s: float | None
    range_sd_m: float
    at_best_percent: float
    manoeuvred: bool
    by_step: Array


@dataclass(frozen=True, kw_only=True)
class Convergence:
    """When the criteria were met, seconds of the file's clock; None for never.

    Attributes:
        first_s: for the first time.
        sustained_s: for good, up to the last bearing; None too for an answer that contradicts
            itself, however sure it is.
        permitted_s: the earliest time at which the Cramér-Rao bound permits them for good.
    """

    first_s: float | None
    sustained_s: float | None
    permitted_s: float | None


@dataclass(frozen=True, kw_only=True)
class Test:
    """One question to the residuals.

    Attributes:
        name: what is asked.
        statistic: its value.
        p_value: how often chance alone gives as much.
        passed: whether that is at least the false-alarm rate.
        words: one sentence for a reader, with figures.
        estimate, sd: of what is asked, where that is a size (degrees, seconds, a correlation);
            None where not.
        asked: whether these bearings can answer it; one that is not asked counts as passed.
        follows: the failed test whose fault would explain that this one failed; None for itself.
    """

    name: str
    statistic: float
    p_value: float
    passed: bool
    words: str
    estimate: float | None = None
    sd: float | None = None
    asked: bool = True
    follows: str | None = None


@dataclass(frozen=True, kw_only=True)
class Residuals:
    """What is left of the bearings when the best straight track is taken off.

    Attributes:
        deg: (steps,), NaN where nothing was heard.
        tests: noise level, whiteness, own ship's clock, and others.
        false_alarm: chance that a good recording fails one test.
    """

    deg: Array
    tests: tuple[Test, ...]
    false_alarm: float


@dataclass(frozen=True, kw_only=True)
class Cells:
    """The bank's cells.

    Attributes:
        range_m: (cells,) the middles they started from.
        side: (cells,) -1 port, 0 where sides are known, 1 starboard.
        weights: (steps, cells).
        mean: (cells, 4) where each has the target at the last bearing: North, East (m), their
            rates (m/s); NaN where it is given up.
    """

    range_m: Array
    side: Array
    weights: Array
    mean: Array


@dataclass(frozen=True, kw_only=True)
class Batch:
    """The batch estimate: the straight track that fits all bearings best, with the prior.

    Attributes:
        mean: (4,) North, East (m), their rates (m/s), at the last bearing.
        cov: (4, 4), from the Fisher information and the prior.
        cost: half the sum of squares at the best track.
        converged: whether the iteration settled.
        range_m, bearing_deg, course_deg, speed_mps: the same, to read.
    """

    mean: Array
    cov: Array
    cost: float
    converged: bool
    range_m: Quantity
    bearing_deg: Quantity
    course_deg: Quantity
    speed_mps: Quantity


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetMotion:
    """The answer for one contact.

    Attributes:
        contact: what was heard.
        filter: its catalogue name.
        bearings: how many were used.
        observability, convergence, criteria: see there.
        range_m, bearing_deg, course_deg, speed_mps: at the last bearing. Without observability,
            range, course and speed have regions and no estimate.
        mean, cov: (4,) and (4, 4): North, East, their rates, by the mixture's moments.
        sides: of a cone, the heavier first; empty for true bearings.
        decided: whether one side has all but a hundredth of the weight.
        history: a row for each bearing: `time_s`, `own_north_m`, `own_east_m`, `heard_deg`,
            `north_m`, `east_m`; `range_m`, `bearing_deg`, `course_deg`, `speed_mps`, each with
            `_sd` and `_bound` before the unit (`range_sd_m`, `range_bound_m`), the bound with the
            prior; `range_low_m`, `range_high_m` (ends of the 90 % region), `innovation_deg`,
            `innovation_sd_deg`, `nis`, `observable`.
        cells: of the bank; one cell for a single filter.
        batch: the reference; None where it did not settle.
        residuals: of the batch estimate.
        settings: everything that was chosen, by name.
        remarks: what the reader must know.
    """

    contact: Contact
    filter: str
    bearings: int
    criteria: Criteria
    observability: Observability
    convergence: Convergence
    range_m: Quantity
    bearing_deg: Quantity
    course_deg: Quantity
    speed_mps: Quantity
    mean: Array
    cov: Array
    sides: tuple[Side, ...]
    decided: bool
    history: "pl.DataFrame"
    cells: Cells
    batch: Batch | None
    residuals: Residuals | None
    settings: dict[str, Any]
    remarks: tuple[str, ...]

    @property
    def observable(self) -> bool:
        """Whether bearings alone tell the range."""
        return self.observability.observable

    @property
    def converged_s(self) -> float | None:
        """Since when the criteria are met for good; None for never."""
        return self.convergence.sustained_s


@dataclass(frozen=True, kw_only=True, eq=False)
class TmaResult:
    """The answers for all contacts of a file, the one with most bearings first."""

    contacts: tuple[TargetMotion, ...]
    remarks: tuple[str, ...] = ()

    @property
    def main(self) -> TargetMotion:
        """The contact with most bearings."""
        return self.contacts[0]

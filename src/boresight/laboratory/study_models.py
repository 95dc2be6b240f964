"""What may stand in a study file, as pydantic models: names, kinds, units and ranges.

Numbers leave here in the models' own units (m, deg, s, m/s, ...). Nothing is looked up or read:
whether a filter, a scenario or a recording is there is for those that make them.
"""

from functools import partial
from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
)

from boresight.errors import UsageError
from boresight.experiments.scenario import Begin
from boresight.experiments.spreads import Normal, Spread, Uniform
from boresight.laboratory import quantities as q
from boresight.laboratory.study import Draws, Metric

_LEG = [["20 km", "-30 km"], ["20 km", "40 km"]]
DEFAULT_RUNS = 1000
LARGEST_SEED = 2**64 - 1
LONGEST_LABEL = 60


def _quantity(kind: q.Kind) -> BeforeValidator:
    return BeforeValidator(partial(q.quantity, kind=kind))


def _spread(kind: q.Kind) -> BeforeValidator:
    return BeforeValidator(partial(_as_spread, kind=kind))


def _as_spread(value: Any, kind: q.Kind) -> Spread:
    """["1 km", "9 km"]: any value between; {mean = "5 km", sd = "1 km"}: normal; or one value."""
    try:
        if isinstance(value, list) and len(value) == 2:
            return Uniform(*(q.quantity(each, kind) for each in value))
        if isinstance(value, dict) and value.keys() == {"mean", "sd"}:
            return Normal(**{name: q.quantity(each, kind) for name, each in value.items()})
    except UsageError as error:
        raise ValueError("is not a spread", error.next_step) from None
    if isinstance(value, list | dict):
        offer = f'["{kind.example}", "..."] or {{ mean = "{kind.example}", sd = "..." }}'
        raise ValueError("is not a spread", f"give {offer}")  # noqa: TRY004 - pydantic's own way
    return Normal(q.quantity(value, kind), 0.0)


def _as_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


def _as_table(value: Any) -> Any:
    """A name alone is a table with a name."""
    return {"name": value} if isinstance(value, str) else value


def _as_label(value: str) -> str:
    if not value.isprintable() or len(value) > LONGEST_LABEL:
        raise ValueError("is no label", f"give one line of at most {LONGEST_LABEL} characters")
    return value


Length = Annotated[float, _quantity(q.LENGTH)]
Angle = Annotated[float, _quantity(q.ANGLE)]
Time = Annotated[float, Field(gt=0), _quantity(q.TIME)]
Speed = Annotated[float, _quantity(q.SPEED)]
Acceleration = Annotated[float, _quantity(q.ACCELERATION)]
Jerk = Annotated[float, _quantity(q.JERK)]
TurnAcceleration = Annotated[float, _quantity(q.TURN_ACCELERATION)]
Drift = Annotated[float, _quantity(q.DRIFT)]
Share = Annotated[float, _quantity(q.SHARE)]
Positive = Field(gt=0)
NotNegative = Field(ge=0)
AtLeastOne = Field(ge=1)
Point = Annotated[list[Length], Field(min_length=2, max_length=3)]
Place = Annotated[tuple[Angle, Angle, Length], Field(strict=False)]
Quantity = TypeVar("Quantity")


class Table(BaseModel):
    """A table that has these settings and no others."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Measured(Table, Generic[Quantity]):
    """A component of plots: standard deviation of its noise, and a bias that no filter knows."""

    sigma: Annotated[Quantity, Positive] | None = None
    bias: Quantity | None = None


class MeasuredRate(Measured[Speed]):
    """Range rate, whose noise may be correlated with the range's."""

    correlation: Annotated[float, Field(gt=-1, lt=1)] | None = None


class CarrierTable(Table):
    """What carries a sensor: own ship, or an aircraft; as `waypoints` has it."""

    points: Annotated[list[Point], Field(min_length=2, examples=[_LEG])]
    speed: Annotated[
        list[Annotated[Speed, Positive]], Field(min_length=1), BeforeValidator(_as_list)
    ]
    lateral_accel: Annotated[Acceleration, Positive] | None = None


class SensorTable(Table):
    """What sees the target. Of a paper's scenario, what is not given is the paper's."""

    range: Measured[Length] | None = None
    azimuth: Measured[Angle] | None = None
    elevation: Measured[Angle] | None = None
    cone: Measured[Angle] | None = None
    height: Measured[Length] | None = None
    pressure_altitude: Measured[Length] | None = None
    range_rate: MeasuredRate | None = None
    period: Time | None = None
    position: Point | None = None
    heading: Angle | None = None
    carrier: CarrierTable | None = None
    detection: Annotated[Share, Field(gt=0, le=1)] | None = None
    false_plots: Annotated[float, NotNegative] | None = None
    coverage: Annotated[Length, Positive] | None = None


class PaperTable(Table):
    """A scenario of one of the papers."""

    kind: Literal["paper"] = "paper"
    name: Annotated[str, Field(examples=["kashyap-set-2"])]


class WaypointsTable(CarrierTable):
    """Straight legs, joined by level turns."""

    kind: Literal["waypoints"]
    name: str = "waypoints"
    scans: Annotated[int, AtLeastOne] | None = None
    site: Place | None = None


class RecordedTable(Table):
    """A flight that was recorded."""

    kind: Literal["recorded"]
    name: str = "recorded"
    file: Annotated[str, Field(examples=["flight.csv"])]
    site: Annotated[Place, Field(examples=[["47 deg", "8 deg", "400 m"]])]
    target: str | None = None
    columns: dict[str, str] = {}
    scans: Annotated[int, AtLeastOne] | None = None


class RandomTable(Table):
    """Targets that start anywhere: in a ring, or by North and East."""

    kind: Literal["random"]
    name: str = "random"
    scans: Annotated[int, Field(ge=1, examples=[60])]
    site: Place | None = None
    range: Annotated[Any, _spread(q.LENGTH)] = None
    azimuth: Annotated[Any, _spread(q.ANGLE)] = Uniform(0.0, 360.0)
    north: Annotated[Any, _spread(q.LENGTH)] = None
    east: Annotated[Any, _spread(q.LENGTH)] = None
    speed: Annotated[Any, _spread(q.SPEED)]
    heading: Annotated[Any, _spread(q.ANGLE)] = Uniform(0.0, 360.0)
    height: Annotated[Any, _spread(q.LENGTH)] = Normal(0.0, 0.0)
    climb: Annotated[Any, _spread(q.SPEED)] = Normal(0.0, 0.0)


def _kind(value: Any) -> Any:
    return value.get("kind", "paper") if isinstance(value, dict) else "paper"


World = PaperTable | WaypointsTable | RecordedTable | RandomTable
AnyWorld = Annotated[
    Annotated[PaperTable, Tag("paper")]
    | Annotated[WaypointsTable, Tag("waypoints")]
    | Annotated[RecordedTable, Tag("recorded")]
    | Annotated[RandomTable, Tag("random")],
    Discriminator(_kind),
    BeforeValidator(_as_table),
]


class StartTable(Table):
    """How tracks begin, and what a start from one plot or on a bearing cannot know."""

    kind: Begin | None = None
    speed_sd: Annotated[Speed, Positive] | None = None
    range: Annotated[Length, Positive] | None = None
    range_sd: Annotated[Length, Positive] | None = None


class MotionTable(Table):
    """How targets move, or are believed to; which settings a kind has is for who makes it."""

    kind: (
        Literal["constant-velocity", "constant-acceleration", "coordinated-turn", "static"] | None
    ) = None
    dims: Literal[2, 3] | None = None
    accel: Annotated[Acceleration, NotNegative] | None = None
    jerk: Annotated[Jerk, NotNegative] | None = None
    turn_accel: Annotated[TurnAcceleration, NotNegative] | None = None
    drift: Annotated[Drift, NotNegative] | None = None
    discretisation: str | None = None


class FilterTable(BaseModel):
    """A filter with what it believes; further settings are the filter's own."""

    model_config = ConfigDict(extra="allow", frozen=True, strict=True, allow_inf_nan=False)

    name: Annotated[str, Field(examples=["ekf"])]
    label: Annotated[str, AfterValidator(_as_label)] | None = None
    motion: MotionTable | None = None
    noise_scale: Annotated[float, Positive] = 1.0
    gate: Annotated[float, Positive] | None = None


class SplitTable(Table):
    """Whether each run has a truth, and noise, of its own, or all share those of run 0."""

    truth: Draws = "each"
    noise: Draws = "each"


class LimitsTable(Table):
    """Numbers that metrics need."""

    converged: Annotated[Length, Positive] | None = None
    cutoff: Annotated[Length, Positive] | None = None
    order: Annotated[float, Field(ge=1)] | None = None
    lost: Annotated[Length, Positive] | None = None


class StudyFile(Table):
    """The whole file. What must be there and is not is for those that need it."""

    name: str | None = None
    runs: Annotated[int, AtLeastOne] = DEFAULT_RUNS
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] = 0
    metrics: Annotated[list[Metric], Field(min_length=1)] | None = None
    first_scan: Annotated[int, NotNegative] | None = None
    false_alarm: Annotated[Share, Field(gt=0, lt=1)] | None = None
    scenario: AnyWorld | None = None
    motion: MotionTable | None = None
    sensor: SensorTable | None = None
    start: StartTable = StartTable()
    filter: Annotated[
        list[Annotated[FilterTable | None, BeforeValidator(_as_table)]], BeforeValidator(_as_list)
    ] = []
    sweep: dict[str, Annotated[list[Any], Field(min_length=1)]] = {}
    split: SplitTable = SplitTable()
    limits: LimitsTable = LimitsTable()

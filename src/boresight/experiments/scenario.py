"""Scenarios: what a target does, what sees it, and where a filter may begin.

The papers' scenarios are built from `papers/<key>.toml`, where their numbers stand, and nowhere
else. All are in SI units (`bordonaro`'s feet become metres) but for `aditya`, whose lengths are km
(erratum A7): a sensor of that scenario takes its range in km too, whatever its argument is called.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from importlib import resources
from typing import Any, Literal

import numpy as np

from boresight.errors import UsageError, unknown
from boresight.experiments.scenario_checks import check_begin, check_shape, check_sight
from boresight.filters.start import SPEED_MPS
from boresight.maths import Gaussian
from boresight.models.motion import ConstantVelocity, Motion, SphericalUnitRate, Static
from boresight.models.sensors import Bearings, Pose, Radar, Sensor

Array = Any
Begin = Literal["random draw", "given", "one plot", "two plots", "on bearing"]
SPENT: dict[Begin, int] = {
    "random draw": 0,
    "given": 0,
    "one plot": 1,
    "two plots": 2,
    "on bearing": 1,
}
FOOT_M = 0.3048
CEILING_M = 15_000.0  # nothing is reported higher
SPEEDS_MPS = {"m/s": 1.0, "knots": 1852.0 / 3600.0}


@dataclass(frozen=True, kw_only=True, eq=False)
class Scenario:
    """What a target does, what sees it, and where a filter may begin.

    Attributes:
        name: what `simulate` is called with; also the cell of its random numbers.
        motion: how the target moves; its noise moves the truth too.
        sensor: what sees it, unless another is given.
        initial: (n,) where every truth starts, exactly, at time 0; or their centre, if `draw` says
            where each one starts.
        prior_cov: (n, n) how uncertain a filter is of that.
        draw: makes of standard normals (runs, n) the states (runs, n) where truths start; None:
            all start at `initial`.
        begin: `random draw`: each run's filter starts at its own draw from N(initial, prior_cov);
            `given`: at `initial`; `one plot`, `two plots`, `on bearing`: from the first plots,
            which are then not used again.
        speed_mps: spread of each velocity that a start from one plot cannot know.
        range_m, range_sd_m: mean and spread of the range that a start on a bearing cannot know.
        dt_s: s between scans.
        scans: number of scans.
        first_at_start: whether the first scan is at time 0, or one step later.
        path: (scans, n) where the target is at each scan, given and not drawn: no noise moves it.
        detection: probability that a scan sees the target; else its whole plot is missing. The
            scans that make a start always see it.
        bias: added to what the sensor measures, by component (m, rad, m/s), unknown to filters.
        false_plots: expected number of false plots of a scan, Poisson.
        coverage_m: false plots are uniform in range up to this, in azimuth over the circle, in
            coordinates between minus and plus this, in heights up to `CEILING_M`.
        coverage_elevation_deg: lowest and highest elevation of false plots.
        coverage_mps: largest range rate of false plots, either way.
        length_unit: unit of positions and ranges.
        source: paper and section.
    """

    name: str
    motion: Motion
    sensor: Sensor
    initial: Array
    prior_cov: Array
    draw: Callable[[Array], Array] | None = None
    begin: Begin = "random draw"
    speed_mps: float = SPEED_MPS
    range_m: float = np.nan
    range_sd_m: float = np.nan
    dt_s: float = 1.0
    scans: int
    first_at_start: bool = True
    path: Array | None = None
    detection: float = 1.0
    bias: Mapping[str, float] = field(default_factory=dict)
    false_plots: float = 0.0
    coverage_m: float = np.nan
    coverage_elevation_deg: tuple[float, float] = (0.0, 90.0)
    coverage_mps: float = SPEED_MPS
    length_unit: str = "m"
    source: str = ""

    def __post_init__(self) -> None:
        """Lists become arrays, and what cannot be simulated is refused."""
        n = len(self.motion.names)
        shapes = {"initial": (n,), "prior_cov": (n, n), "path": (self.scans, n)}
        for name, shape in shapes.items():
            if getattr(self, name) is not None:
                array = np.asarray(getattr(self, name), dtype=float)
                object.__setattr__(self, name, array)
                check_shape(self, name, shape)
        check_begin(self, SPENT)
        check_sight(self)

    @property
    def metre(self) -> float:
        """Metres in one unit of its lengths."""
        return 1000.0 if self.length_unit == "km" else 1.0

    @property
    def spent(self) -> int:
        """How many scans make the start; their plots are not used again."""
        return SPENT[self.begin]

    @property
    def prior(self) -> Gaussian:
        """What a filter knows before the first plot."""
        return Gaussian(self.initial, self.prior_cov)

    @property
    def dt(self) -> Array:
        """(1, scans): s before each scan."""
        steps = np.full((1, self.scans), self.dt_s)
        steps[0, 0] = 0.0 if self.first_at_start else self.dt_s
        return steps

    @property
    def time_s(self) -> Array:
        """(scans,): when each scan is."""
        return np.cumsum(self.dt[0])


def paper(key: str) -> dict[str, Any]:
    """What `papers/<key>.toml` holds: the numbers a paper prints, and what is assumed."""
    text = (resources.files("boresight.experiments.papers") / f"{key}.toml").read_text("utf-8")
    return tomllib.loads(text)


def _kashyap(name: str, own: dict[str, Any], table: dict[str, Any]) -> Scenario:
    common, dims = table["common"], len(own["initial"]) // 2
    spread = [common["assumed_position_sd_m"]] * dims + [common["assumed_velocity_sd_mps"]] * dims
    return Scenario(
        name=name,
        motion=ConstantVelocity(accel_mps2=common["accel_variance_m2ps4"] ** 0.5, dims=dims),
        sensor=Radar(**own["sigma"]),
        initial=own["initial"],
        prior_cov=np.diag(np.square(spread)),
        begin=common["begin"],
        dt_s=common["dt_s"],
        scans=common["scans"],
        source=own["where"],
    )


def _aditya(name: str, own: dict[str, Any], table: dict[str, Any]) -> Scenario:
    printed, assumed = table["table2"], table["assumed"]
    noise = float(printed["Q"] ** 0.5)
    names = ("sigma_range_km", "sigma_azimuth_rad", "sigma_elevation_rad")
    sigmas = [printed[n] if own["noise"] == "sigma" else printed["R"] ** 0.5 for n in names]
    azimuth_deg, elevation_deg = np.degrees(sigmas[1:])
    return Scenario(
        name=name,
        motion=SphericalUnitRate(position_noise=noise, velocity_noise=noise),
        sensor=Radar(range_m=sigmas[0], azimuth_deg=azimuth_deg, elevation_deg=elevation_deg),
        initial=printed["initial"],
        prior_cov=printed["P0"] * np.eye(len(printed["initial"])),
        begin=assumed["begin"],
        dt_s=printed["dt_s"],
        scans=assumed["scans"],
        first_at_start=False,
        length_unit="km",
        source=own["where"],
    )


def _bordonaro(name: str, own: dict[str, Any], table: dict[str, Any]) -> Scenario:
    printed, rest = table["settings"][own["settings"]], own["velocities"]
    vague = printed["position_sd_ft"] or max(printed["position_ft"])
    spread = [vague] * 2 + [printed["start_speed_ftps"]] * rest
    return Scenario(
        name=name,
        motion=ConstantVelocity(accel_mps2=0.0, dims=2) if rest else Static(dims=2),
        sensor=Radar(
            range_m=FOOT_M * printed["sigma_range_ft"],
            azimuth_deg=max(printed["sigma_bearing_deg"]),
        ),
        initial=FOOT_M * np.array(printed["position_ft"] + [0.0] * rest),
        prior_cov=np.diag(np.square(FOOT_M * np.array(spread))),
        draw=partial(_anywhere, printed) if rest else None,
        begin="one plot",
        speed_mps=FOOT_M * printed["start_speed_ftps"],
        dt_s=table["assumed"]["dt_s"],
        scans=printed["scans"],
        source=own["where"],
    )


def _anywhere(printed: dict[str, Any], normals: Array) -> Array:
    """States [x, y, vx, vy] of targets near a point, of normal speed and uniform heading."""
    from scipy.special import ndtr

    position = printed["position_ft"] + printed["position_sd_ft"] * normals[:, :2]
    speed = printed["speed_ftps"] + printed["speed_sd_ftps"] * normals[:, 2]
    heading = 2.0 * np.pi * ndtr(normals[:, 3])
    velocity = speed * np.array([np.cos(heading), np.sin(heading)])
    return FOOT_M * np.hstack([position, velocity.T])


def _pradeep(name: str, own: dict[str, Any], table: dict[str, Any]) -> Scenario:
    printed, assumed = table["printed"], table["assumed"]
    unit, near, far = _unit(assumed), assumed["nearest_m"], assumed["farthest_m"]
    target = [(printed["range_m"], printed["bearing_deg"])]
    target += [(unit * printed["target_speed"], printed["course_deg"])]
    speed_sd = assumed["speed_sd_mps"]
    return Scenario(
        name=name,
        motion=ConstantVelocity(accel_mps2=float(assumed["accel_mps2"]), dims=2),
        sensor=Bearings(
            azimuth_deg=printed["sigma_bearing_deg"],
            pose=Pose(position_m=_sailed(table, unit * printed["own_speed"], turns=own["turns"])),
        ),
        initial=np.concatenate([along(*each) for each in target]),
        prior_cov=np.diag(np.square([(far - near) / 12**0.5] * 2 + [speed_sd] * 2)),
        draw=partial(_between, assumed) if own["anywhere"] else None,
        begin="on bearing",
        speed_mps=speed_sd,
        range_m=(near + far) / 2.0,
        range_sd_m=(far - near) / 12**0.5,
        dt_s=float(assumed["dt_s"]),
        scans=_scans(table),
        source=own["where"],
    )


def _scans(table: dict[str, Any]) -> int:
    if not table["assumed"]["dt_s"] > 0:
        raise UsageError(f"dt_s={table['assumed']['dt_s']} is no time between bearings")
    return int(table["printed"]["seconds"] / table["assumed"]["dt_s"] + 0.5) + 1


def _unit(assumed: dict[str, Any]) -> float:
    """Of the printed speeds, m/s."""
    if assumed["speed_unit"] not in SPEEDS_MPS:
        raise unknown("speed_unit", assumed["speed_unit"], SPEEDS_MPS)
    return SPEEDS_MPS[assumed["speed_unit"]]


def along(length: Any, direction_deg: Any) -> Array:
    """North and East (2, ...) of so much in a direction from true North."""
    angle = np.radians(direction_deg)
    return length * np.array([np.cos(angle), np.sin(angle)])


def _sailed(table: dict[str, Any], speed_mps: float, *, turns: bool) -> Array:
    """Own ship's positions (1, scans, 3); each step is sailed on the course at its beginning."""
    assumed, scans = table["assumed"], _scans(table)
    time_s, names = assumed["dt_s"] * np.arange(scans), ("times_s", "rates_degps", "lasts_s")
    each = [assumed[f"turn_{name}"] for name in names]
    if len({len(values) for values in each}) != 1:
        raise UsageError(
            f"own ship's turns have {', '.join(str(len(values)) for values in each)} values",
            next_step=f"give as many in each of {', '.join(f'turn_{name}' for name in names)}",
        )
    course = np.full(scans, float(assumed["own_course_deg"]))
    for start, rate, lasts in zip(*each, strict=True) if turns else ():
        course += rate * np.clip(time_s - start, 0.0, lasts)
    path = np.zeros((1, scans, 3))
    steps = along(speed_mps * assumed["dt_s"], course[:-1])
    path[0, 1:, :2] = np.cumsum(steps, axis=1).T
    return path


def _between(assumed: dict[str, Any], normals: Array) -> Array:
    """States of targets on any bearing, of any velocity, in any cell of the range alike."""
    from scipy.special import ndtr

    edges = np.geomspace(assumed["nearest_m"], assumed["farthest_m"], assumed["cells"] + 1)
    where = np.interp(ndtr(normals[:, 0]), np.linspace(0.0, 1.0, len(edges)), edges)
    position = along(where, 360.0 * ndtr(normals[:, 1]))
    return np.hstack([position.T, assumed["speed_sd_mps"] * normals[:, 2:]])


_BUILDERS: dict[str, Callable[[str, dict[str, Any], dict[str, Any]], Scenario]] = {
    "kashyap": _kashyap,
    "aditya": _aditya,
    "bordonaro": _bordonaro,
    "pradeep": _pradeep,
}


def build(key: str, table: dict[str, Any]) -> dict[str, Scenario]:
    """The scenarios of a paper, from its table or from one in which assumptions were changed."""
    return {name: _BUILDERS[key](name, own, table) for name, own in table["scenarios"].items()}


@cache
def _scenarios() -> dict[str, Scenario]:
    return {name: one for key in _BUILDERS for name, one in build(key, paper(key)).items()}


def scenario_names() -> tuple[str, ...]:
    """Names of the papers' scenarios."""
    return tuple(_scenarios())


def lookup(name: str) -> Scenario:
    """The scenario of that name; UsageError with the nearest valid name if there is none."""
    known = _scenarios()
    if name in known:
        return known[name]
    raise unknown("scenario", name, known)

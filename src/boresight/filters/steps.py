"""One step of a filter: what it keeps of a target, how it begins, predicts, updates and tells.

Most filters keep a Gaussian in the motion's own coordinates, and `Updating` makes such a one of an
update formula. A filter that keeps something else (another frame, several Gaussians, the plot
before) is a `Method` of its own; what it tells is always a Gaussian in the motion's coordinates.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

from boresight.filters import kalman
from boresight.filters.posterior import Posterior
from boresight.filters.start import SPEED_MPS, one_plot
from boresight.lanes import Leaf, Symmetric, Vector
from boresight.maths import Gaussian
from boresight.models.components import Component
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor

Array = Any
State = Mapping[str, Any]
Update = Callable[..., Posterior]
Predict = Callable[[Gaussian, Motion, Any], Gaussian]


class Surprise(NamedTuple):
    """How surprising a plot was; fields as in `Posterior`."""

    nis: Any
    dof: Any
    loglik: Any
    innovation: Array
    variance: Array


class Method(Protocol):
    """A filter for one motion and sensor. Frozen data: its settings are structure.

    All functions but `start` are formulas for one target, recorded once for all lanes.
    """

    @property
    def plain(self) -> bool:
        """Whether the state is a mean and a cov in the motion's coordinates, told as it is."""

    def start(
        self, z: Array, motion: Motion, sensor: Sensor, *, speed_mps: float = ...
    ) -> Gaussian:
        """A Gaussian for every lane from its first plot: (lanes, k) to mean (lanes, n)."""

    def layout(self, motion: Motion, sensor: Sensor) -> dict[str, Leaf]:
        """What is kept of one target, by name."""

    def begin(self, start: Gaussian, motion: Motion, sensor: Sensor) -> State:
        """What is kept, from a Gaussian in the motion's coordinates."""

    def predict(self, state: State, motion: Motion, sensor: Sensor, dt: Any) -> State:
        """What is kept dt seconds later; the sensor is where it is then."""

    def update(
        self, state: State, z: Array, motion: Motion, sensor: Sensor
    ) -> tuple[State, Surprise]:
        """Condition on a plot (k,), NaN where missing."""

    def output(self, state: State, motion: Motion, sensor: Sensor) -> Gaussian:
        """What is told: mean (n,) and cov (n, n) in the motion's coordinates."""


@runtime_checkable
class Seeing(Protocol):
    """A filter whose plots are of something else than what it tells."""

    def seen(
        self, state: State, motion: Motion, sensor: Sensor
    ) -> tuple[Gaussian, Sequence[Component]]:
        """What its plots are of, and the formulas of what is measured of that."""


class Guard(Protocol):
    """Decides whether a plot can be the target's; a frozen dataclass of numbers.

    One that has `candidates` is given so many plots (candidates, k), of which it takes one at most.
    """

    def admit(
        self, prior: Gaussian, z: Array, components: Sequence[Component]
    ) -> tuple[Array, Any]:
        """The plot, NaN if it is turned away, and 1 if it was admitted, else 0."""


def gaussian_layout(motion: Motion) -> dict[str, Leaf]:
    """The state of a filter that keeps a Gaussian in the motion's coordinates."""
    n = len(motion.names)
    return {"mean": Vector(n), "cov": Symmetric(n)}


def judged(
    method: Method, state: State, motion: Motion, sensor: Sensor
) -> tuple[Gaussian, Sequence[Component]]:
    """What a gate holds plots against: what is told, unless the filter says what plots are of."""
    if isinstance(method, Seeing):
        return method.seen(state, motion, sensor)
    return method.output(state, motion, sensor), sensor.components(motion)


@dataclass(frozen=True, kw_only=True)
class Updating:
    """A filter that keeps a Gaussian in the motion's coordinates: a prediction and an update.

    Attributes:
        formula: (prior, z, components, **settings) -> Posterior.
        settings: keyword arguments of the formula.
        moved: (prior, motion, dt) -> Gaussian, the prediction.
        conversion: of the first plot: `conventional` goes with a filter that linearises, `mucm`
            (the moments of the position given the plot) with one that takes moments.
    """

    formula: Update
    settings: tuple[tuple[str, Any], ...] = ()
    moved: Predict = kalman.predict
    conversion: str = "conventional"

    @property
    def plain(self) -> bool:
        """It tells what it keeps."""
        return True

    def start(
        self, z: Array, motion: Motion, sensor: Sensor, *, speed_mps: float = SPEED_MPS
    ) -> Gaussian:
        """Position by the conversion, velocity unknown."""
        chosen = self.conversion
        return one_plot(z, motion, sensor, speed_mps=speed_mps, conversion=chosen)

    def layout(self, motion: Motion, sensor: Sensor) -> dict[str, Leaf]:
        """Mean and covariance."""
        del sensor
        return gaussian_layout(motion)

    def begin(self, start: Gaussian, motion: Motion, sensor: Sensor) -> State:
        """The Gaussian itself."""
        del motion, sensor
        return {"mean": start.mean, "cov": start.cov}

    def predict(self, state: State, motion: Motion, sensor: Sensor, dt: Any) -> State:
        """By the motion; where the sensor is does not matter."""
        del sensor
        return self.moved(Gaussian(state["mean"], state["cov"]), motion, dt)._asdict()

    def update(
        self, state: State, z: Array, motion: Motion, sensor: Sensor
    ) -> tuple[State, Surprise]:
        """By the formula, on components of independent noise."""
        prior = Gaussian(state["mean"], state["cov"])
        z, components = sensor.independent(z, motion)
        post = self.formula(prior, z, components, **dict(self.settings))
        return {"mean": post.mean, "cov": post.cov}, Surprise(*post[2:])

    def output(self, state: State, motion: Motion, sensor: Sensor) -> Gaussian:
        """The Gaussian itself."""
        del motion, sensor
        return Gaussian(state["mean"], state["cov"])

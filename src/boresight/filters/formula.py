"""A step of a motion and a sensor, recorded once for all values of their numbers.

What filters have in `filters.recursion`, for what is not a filter: a world that moves and is seen,
a bound along a trajectory.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from boresight.lanes import Kernel, Leaf, Rate, States, make_kernel, pack_states, trace
from boresight.models.motion import Motion
from boresight.models.parameters import numbers, rate_of, structure, with_numbers
from boresight.models.sensors import Sensor

Array = Any
Step = Callable[[Motion, Sensor, Mapping[str, Any], Mapping[str, Any]], tuple[Any, Any]]


@dataclass(frozen=True, eq=False)
class Formula:
    """A step and the shapes of what it takes and gives; equal when it records the same program.

    Attributes:
        step: (motion, sensor, state, inputs) -> (new state, outputs), for one target.
        motion, sensor: the models; their numbers are inputs of the kernel.
        state: leaves that travel from step to step.
        inputs: leaves and how often they change.
        outputs: leaves that are written at every step; none where only the last state counts.
    """

    step: Step
    motion: Motion
    sensor: Sensor
    state: tuple[tuple[str, Leaf], ...]
    inputs: tuple[tuple[str, Leaf, Rate], ...]
    outputs: tuple[tuple[str, Leaf], ...]

    @property
    def _identity(self) -> tuple[Any, ...]:
        models = structure(self.motion), structure(self.sensor)
        return (self.step, *models, self.state, self.inputs, self.outputs)

    def __hash__(self) -> int:
        return hash(self._identity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Formula) and self._identity == other._identity

    def run(
        self, start: Mapping[str, Array], inputs: Mapping[str, Array], steps: int
    ) -> dict[str, Array]:
        """Run all lanes, from start (lanes, *shape) to outputs (lanes, steps, *shape)."""
        return self.carry(start, inputs, steps)[1]

    def carry(
        self, start: Mapping[str, Array], inputs: Mapping[str, Array], steps: int
    ) -> tuple[States, dict[str, Array]]:
        """As `run`, with what travelled from step to step, as it is after the last one.

        Of numbers that change with the step the first `steps` are used.
        """
        rated = {n: rate_of(n, value, leaf) for n, (value, leaf) in self.numbers().items()}
        kernel = _kernel(self, tuple((name, rate) for name, (rate, _) in rated.items()))
        values = {n: _first(steps, *pair) for n, pair in rated.items()} | dict(inputs)
        return kernel.run(pack_states(kernel.program.state, start), values, steps)

    def numbers(self) -> dict[str, tuple[Any, Leaf]]:
        """Numbers of both models, by name."""
        return numbers(self.motion, "motion") | numbers(self.sensor, "sensor")


def _first(steps: int, rate: Rate, value: Array) -> Array:
    """A number's first steps."""
    if rate is Rate.STEP:
        return value[:steps]
    return value[:, :steps] if rate is Rate.EACH else value


@lru_cache(maxsize=64)
def _kernel(formula: Formula, rates: tuple[tuple[str, Rate], ...]) -> Kernel:
    rate = dict(rates)

    def step(state: dict[str, Any], inputs: dict[str, Any]) -> tuple[Any, Any]:
        motion = with_numbers(formula.motion, "motion", inputs)
        sensor = with_numbers(formula.sensor, "sensor", inputs)
        return formula.step(motion, sensor, state, inputs)

    models = {name: (leaf, rate[name]) for name, (_, leaf) in formula.numbers().items()}
    return make_kernel(
        trace(
            step,
            state=dict(formula.state),
            inputs={name: (leaf, when) for name, leaf, when in formula.inputs} | models,
            outputs={name: (leaf, Rate.EACH) for name, leaf in formula.outputs},
        )
    )

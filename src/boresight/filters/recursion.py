"""Predict and update, recorded once for a filter, a motion and a sensor, run over all lanes.

The filter is any `steps.Method`. Numbers of the motion and the sensor are inputs of the kernel, so
noises and poses may be fixed, per lane, per step or both, and one kernel serves all their values.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from boresight.errors import Status, UsageError
from boresight.filters.steps import Guard, Method, judged
from boresight.lanes import (
    Kernel,
    Leaf,
    Matrix,
    Rate,
    Scalar,
    States,
    Symmetric,
    Vector,
    make_kernel,
    pack_states,
    trace,
)
from boresight.lanes.program import Slot
from boresight.maths import Gaussian, elimination, select
from boresight.models.considered import own_states
from boresight.models.motion import Motion
from boresight.models.parameters import numbers, rate_of, structure, with_numbers
from boresight.models.sensors import Sensor

Array = Any
OUTPUTS = ("mean", "cov", "nis", "dof", "loglik", "innovation", "variance", "status", "inside")
SUMMARY = ("nis", "dof", "loglik", "status")  # what a stream keeps of every step


def leaves(n: int, k: int) -> dict[str, Leaf]:
    """Shape of every output for n states and k components."""
    return {
        "mean": Vector(n),
        "cov": Symmetric(n),
        "nis": Scalar(),
        "dof": Scalar(),
        "loglik": Scalar(),
        "innovation": Vector(k),
        "variance": Vector(k),
        "status": Scalar(),
        "inside": Scalar(),
        "summary": Vector(len(SUMMARY)),
        "told": Vector(len(SUMMARY) + n + n * (n + 1) // 2),
    }


def status_of(mean: Array, cov: Array) -> Any:
    """`Status` of a state: not finite, not positive definite, or well."""
    total = sum(abs(x) for x in mean) + sum(abs(cov[i, i]) for i in range(len(mean)))
    finite = total < np.inf  # NaN and infinity fail this
    pivots = elimination(cov)
    positive = pivots[0] > 0.0
    for pivot in pivots[1:]:
        positive = positive & (pivot > 0.0)
    bad = select(positive, float(Status.OK), float(Status.NOT_POSITIVE))
    return select(finite, bad, float(Status.NOT_FINITE))


@dataclass(frozen=True)
class Recursion:
    """A filter step with its models' structure: what a kernel is made from.

    Attributes:
        method: the filter.
        motion, sensor: the models; their numbers are not part of the recursion's identity.
        guard: turns away plots that cannot be the target's, before the update sees them.
    """

    method: Method
    motion: Motion
    sensor: Sensor
    guard: Guard | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Number of states and of components."""
        return len(self.motion.names), len(self.sensor.names)

    @property
    def plot(self) -> Leaf:
        """What comes at a step: a plot, or the candidates that the guard chooses from."""
        k, many = len(self.sensor.names), getattr(self.guard, "candidates", None)
        return Vector(k) if many is None else Matrix(many, k)

    @property
    def layout(self) -> dict[str, Leaf]:
        """What travels from step to step."""
        return self.method.layout(self.motion, self.sensor)

    @property
    def kept(self) -> dict[str, Leaf]:
        """What travels from step to step, as outputs."""
        return {f"kept_{name}": leaf for name, leaf in self.layout.items()}

    def models(self) -> dict[str, tuple[Any, Leaf]]:
        """Numbers of both models."""
        found = numbers(self.motion, "motion") | numbers(self.sensor, "sensor")
        return found | numbers(self.guard, "guard") if self.guard else found

    def with_inputs(self, values: Mapping[str, Any]) -> tuple[Motion, Sensor]:
        """Both models with their numbers replaced."""
        given = dict(values)
        motion = with_numbers(self.motion, "motion", given)
        return motion, with_numbers(self.sensor, "sensor", given)

    def begin(self, mean: Array, cov: Array) -> Mapping[str, Any]:
        """What the method keeps of one target that starts at a Gaussian (n,), (n, n)."""
        return self.method.begin(Gaussian(mean, cov), self.motion, self.sensor)

    def step(self, state: Mapping[str, Any], inputs: Mapping[str, Any]) -> tuple[Any, Any]:
        """One prediction and update of one target; the formula that is recorded."""
        motion, sensor = self.with_inputs(inputs)
        prior = self.method.predict(state, motion, sensor, inputs["dt"])
        z, inside = inputs["z"], 1.0
        if self.guard:
            guard = with_numbers(self.guard, "guard", dict(inputs))
            known, components = judged(self.method, prior, motion, sensor)
            z, inside = guard.admit(known, z, components)
        post, surprise = self.method.update(prior, z, motion, sensor)
        told = self.method.output(post, motion, sensor)
        results = surprise._asdict() | {"mean": told.mean, "cov": told.cov, "inside": inside}
        own = own_states(motion)
        results["status"] = status_of(told.mean[:own], told.cov[:own, :own])
        results |= {f"kept_{name}": leaf for name, leaf in post.items()}
        results["summary"] = np.array([results[name] for name in SUMMARY])
        upper = told.cov[np.triu_indices(len(told.mean))]
        results["told"] = np.concatenate([results["summary"], told.mean, upper])
        return post, results

    def kernel(self, rates: Mapping[str, Rate], outputs: Mapping[str, Rate]) -> Kernel:
        """The compiled step, kept for the next call with the same structure and rates."""
        wanted, given = tuple(sorted(outputs.items())), tuple(sorted(rates.items()))
        return _kernel(_Key(self), given, wanted)

    def states(self, start: Gaussian, lanes: int) -> States:
        """Blocked states from mean (n,) or (lanes, n) and cov (n, n) or (lanes, n, n)."""
        mean, cov = spread(start, lanes)
        slots = tuple(Slot(name, leaf) for name, leaf in self.layout.items())
        if self.method.plain:
            return pack_states(slots, {"mean": mean, "cov": cov})
        first = {name: _first_step(*rate_of(name, *pair)) for name, pair in self.models().items()}
        rates = tuple(sorted((name, rate) for name, (rate, _) in first.items()))
        given = {name: value for name, (_, value) in first.items()}
        empty = {slot.name: np.zeros((lanes, *slot.leaf.shape)) for slot in slots}
        begun, _ = _begin_kernel(_Key(self), rates).run(
            pack_states(slots, empty), given | {"mean": mean, "cov": cov}, 1
        )
        return begun


def _first_step(rate: Rate, value: Array) -> tuple[Rate, Array]:
    """What a number is at the first step: one to begin with, whatever it becomes."""
    if rate is Rate.STEP:
        return Rate.FIXED, value[0]
    return (Rate.LANE, value[:, 0]) if rate is Rate.EACH else (rate, value)


class _Key:
    """Compares recursions by what their formula depends on."""

    def __init__(self, recursion: Recursion) -> None:
        models = (recursion.motion, recursion.sensor, recursion.guard)
        self.recursion = recursion
        self.identity = (recursion.method, *(structure(m) for m in models if m is not None))

    def __hash__(self) -> int:
        return hash(self.identity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self.identity == other.identity


@lru_cache(maxsize=128)
def _kernel(
    key: _Key, rates: tuple[tuple[str, Rate], ...], outputs: tuple[tuple[str, Rate], ...]
) -> Kernel:
    recursion, rate = key.recursion, dict(rates)
    n, k = recursion.size
    known = leaves(n, k) | recursion.kept
    shapes = {"z": recursion.plot, "dt": Scalar()}
    shapes |= {name: leaf for name, (_, leaf) in recursion.models().items()}
    return make_kernel(
        trace(
            recursion.step,
            state=recursion.layout,
            inputs={name: (shape, rate[name]) for name, shape in shapes.items()},
            outputs={name: (_full(known[name]), when) for name, when in outputs},
        )
    )


@lru_cache(maxsize=128)
def _begin_kernel(key: _Key, rates: tuple[tuple[str, Rate], ...]) -> Kernel:
    """From a Gaussian to what the method keeps, over lanes."""
    recursion, rate = key.recursion, dict(rates)
    n, _ = recursion.size

    def step(_: Any, inputs: Mapping[str, Any]) -> tuple[Any, Any]:
        models = recursion.with_inputs(inputs)
        start = Gaussian(inputs["mean"], inputs["cov"])
        return recursion.method.begin(start, *models), {}

    shapes = {name: (leaf, rate[name]) for name, (_, leaf) in recursion.models().items()}
    shapes |= {"mean": (Vector(n), Rate.LANE), "cov": (Symmetric(n), Rate.LANE)}
    return make_kernel(trace(step, state=recursion.layout, inputs=shapes, outputs={}))


def _full(leaf: Leaf) -> Leaf:
    """Covariances leave as full matrices: a caller's NumPy needs no unpacking."""
    return Matrix(*leaf.shape) if leaf.symmetric else leaf


def spread(start: Gaussian, lanes: int) -> tuple[Array, Array]:
    """Mean (lanes, n) and cov (lanes, n, n) of a Gaussian whose leading axis may be absent."""
    n = np.shape(start.mean)[-1]
    leading = {*np.shape(start.mean)[:-1], *np.shape(start.cov)[:-2]}
    if np.shape(start.cov)[-2:] != (n, n) or leading - {1, lanes}:
        raise UsageError(
            f"a start with mean {np.shape(start.mean)} and cov {np.shape(start.cov)}",
            why=f"it must be ({lanes}, n) and ({lanes}, n, n), or (n,) and (n, n)",
        )
    mean = np.broadcast_to(np.asarray(start.mean, dtype=float), (lanes, n))
    return mean, np.broadcast_to(np.asarray(start.cov, dtype=float), (lanes, n, n))


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a filter says of every lane at every step.

    Attributes:
        mean: (lanes, steps, n).
        cov: (lanes, steps, n, n).
        others: further outputs by name, (lanes, steps, ...): `nis`, `dof`, `loglik`,
            `innovation`, `variance`, `status`. Outputs that were not asked for are absent.
        final: the state after the last step.
    """

    others: dict[str, Array]
    final: States

    def __getattr__(self, name: str) -> Array:
        """Outputs by name."""
        try:
            return self.__dict__["others"][name]
        except KeyError:
            raise AttributeError(name) from None


def run_recursion(
    recursion: Recursion,
    z: Array,
    dt: Array,
    start: Gaussian | States,
    *,
    outputs: Sequence[str] = ("mean", "cov", "nis"),
    last: bool = False,
    threads: int = 1,
) -> Estimate:
    """Filter every lane.

    Args:
        recursion: what to run.
        z: plots (lanes, steps, k), SI units and radians, NaN where missing; (lanes, steps, m, k)
            for a guard that chooses from m.
        dt: seconds before each step: a number, (1, steps), (lanes, 1) or (lanes, steps).
        start: Gaussian with mean (n,) or (lanes, n), or states of an earlier call.
        outputs: which of `OUTPUTS` to write; the rest is not computed. `kept_` and a name of the
            filter's layout is what it keeps, such as `kept_mean`.
        last: write outputs after the last step only.
        threads: how many threads share the lanes.
    """
    z, plot = np.asarray(z, dtype=float), recursion.plot.shape
    if z.shape[2:] != plot:
        raise UsageError(
            f"plots have shape {z.shape}; (lanes, steps, {', '.join(map(str, plot))}) is needed",
            why=f"the sensor measures {', '.join(recursion.sensor.names)}",
        )
    unknown = sorted(set(outputs) - set(OUTPUTS) - set(recursion.kept))
    if unknown:
        raise UsageError(f"no output {unknown[0]!r}", next_step=f"use {', '.join(OUTPUTS)}")
    given = {"dt": (dt, Scalar())} | recursion.models()
    rated = {name: rate_of(name, value, leaf) for name, (value, leaf) in given.items()}
    rates = {name: rate for name, (rate, _) in rated.items()} | {"z": Rate.EACH}
    when = Rate.LANE if last else Rate.EACH
    kernel = recursion.kernel(rates, dict.fromkeys(outputs, when))
    states = start if isinstance(start, States) else recursion.states(start, z.shape[0])
    values = {name: value for name, (_, value) in rated.items()} | {"z": z}
    final, results = kernel.run(states, values, z.shape[1], threads=threads)
    return Estimate(results, final)

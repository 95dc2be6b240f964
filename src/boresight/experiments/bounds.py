"""How well any filter could do: the Cramer-Rao bound along each trajectory.

[tichavsky1998] P. Tichavsky, C. H. Muravchik and A. Nehorai, "Posterior Cramer-Rao Bounds for
Discrete-Time Nonlinear Filtering"; [taylor1979] J. H. Taylor, "The Cramer-Rao Estimation Error
Lower Bound Computation for Deterministic Nonlinear Systems".
Differs from them: in covariance form, because G Q G' is singular and has no inverse. Then the
bound's recursion is the extended Kalman filter's, linearised at the truth.

Which average: the expectation of the information over random trajectories is dominated by the few
that pass near the sensor (for an azimuth it diverges logarithmically) and says little about a
typical run. Here every trajectory has its own bound, and covariances are averaged.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from boresight.experiments.metrics import ALL, elements
from boresight.experiments.simulate import Plots, Truth
from boresight.filters.ekf import condition
from boresight.filters.kalman import predict
from boresight.lanes import (
    Kernel,
    Matrix,
    Rate,
    Scalar,
    Symmetric,
    Vector,
    make_kernel,
    pack_states,
    trace,
)
from boresight.maths import Gaussian, gradient, missing, select
from boresight.models.motion import Motion
from boresight.models.parameters import numbers, rate_of, structure, with_numbers
from boresight.models.sensors import Sensor

Array = Any


def bound_per_trajectory(truth: Truth, plots: Plots, motion: Motion, sensor: Sensor) -> Array:
    """Cramer-Rao bound along each run's own trajectory.

    Args:
        truth: the trajectories; at these the models are linearised.
        plots: which components were measured, when, and how uncertain the start is.
        motion: how targets move.
        sensor: what sees them.

    Returns:
        (runs, scans, n, n) covariances, after each scan.
    """
    runs, scans, n = truth.states.shape
    rated = {
        name: rate_of(name, value, leaf)
        for name, (value, leaf) in (numbers(motion, "motion") | numbers(sensor, "sensor")).items()
    }
    kernel = _kernel(_Bound(motion, sensor), tuple((k, rate) for k, (rate, _) in rated.items()))
    values = {name: value for name, (_, value) in rated.items()}
    values |= {"dt": plots.dt[0], "now": truth.states, "z": plots.z}
    cov = np.broadcast_to(plots.prior.cov, (runs, n, n))
    start = pack_states(kernel.program.state, {"before": truth.states[:, 0], "cov": cov})
    return kernel.run(start, values, scans)[1]["cov"]


class _Bound:
    """A motion and a sensor, equal when their formulas are."""

    def __init__(self, motion: Motion, sensor: Sensor) -> None:
        self.motion, self.sensor = motion, sensor
        self._identity = (structure(motion), structure(sensor))

    def __hash__(self) -> int:
        return hash(self._identity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Bound) and self._identity == other._identity

    def step(self, state: Mapping[str, Any], inputs: Mapping[str, Any]) -> tuple[Any, Any]:
        """Covariance of a filter that knows where to linearise; the formula that is recorded."""
        values = dict(inputs)
        motion = with_numbers(self.motion, "motion", values)
        sensor = with_numbers(self.sensor, "sensor", values)
        cov = predict(Gaussian(state["before"], state["cov"]), motion, inputs["dt"]).cov
        now = Gaussian(inputs["now"], cov)
        for component, measured in zip(sensor.components(motion), inputs["z"], strict=True):
            _, h = gradient(component.value, now.mean)
            there = select(missing(measured), 0.0, 1.0)
            now, _ = condition(now, h, 0.0, component.sigma * component.sigma, there)
        return {"before": inputs["now"], "cov": now.cov}, {"cov": now.cov}


@lru_cache(maxsize=32)
def _kernel(bound: _Bound, rates: tuple[tuple[str, Rate], ...]) -> Kernel:
    n, k = len(bound.motion.names), len(bound.sensor.names)
    models = numbers(bound.motion, "motion") | numbers(bound.sensor, "sensor")
    rate = dict(rates)
    inputs = {
        "dt": (Scalar(), Rate.STEP),
        "now": (Vector(n), Rate.EACH),
        "z": (Vector(k), Rate.EACH),
    }
    return make_kernel(
        trace(
            bound.step,
            state={"before": Vector(n), "cov": Symmetric(n)},
            inputs=inputs | {name: (leaf, rate[name]) for name, (_, leaf) in models.items()},
            outputs={"cov": (Matrix(n, n), Rate.EACH)},
        )
    )


def average_in_covariance(
    bound: Array, names: tuple[str, ...], *, of: str = "position", scans: slice = ALL
) -> float:
    """Root of the mean variance over runs and scans: what `metrics.rmse` is held against.

    Args:
        bound: (runs, scans, n, n), from `bound_per_trajectory`.
        names: of the state's elements.
        of: `position`, `velocity`, or the name of one element.
        scans: which scans.
    """
    at = elements(names, of)
    return float(np.sqrt(np.mean(np.sum(bound[:, scans, at, at], axis=-1))))

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
from typing import Any

import numpy as np

from boresight.experiments.metrics import ALL, elements
from boresight.experiments.simulate import Plots, Truth
from boresight.filters.ekf import condition
from boresight.filters.formula import Formula
from boresight.filters.kalman import predict
from boresight.lanes import Matrix, Rate, Scalar, Symmetric, Vector
from boresight.maths import Gaussian, gradient, missing, select
from boresight.models.motion import Motion
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
    formula = Formula(
        step=_step,
        motion=motion,
        sensor=sensor,
        state=(("before", Vector(n)), ("cov", Symmetric(n))),
        inputs=(
            ("dt", Scalar(), Rate.STEP),
            ("now", Vector(n), Rate.EACH),
            ("z", Vector(len(sensor.names)), Rate.EACH),
        ),
        outputs=(("cov", Matrix(n, n)),),
    )
    start = {"before": truth.start, "cov": np.broadcast_to(plots.prior.cov, (runs, n, n))}
    inputs = {"dt": plots.dt[0], "now": truth.states, "z": plots.z}
    return formula.run(start, inputs, scans)["cov"]


def _step(
    motion: Motion, sensor: Sensor, state: Mapping[str, Any], inputs: Mapping[str, Any]
) -> tuple[Any, Any]:
    """Covariance of a filter that knows where to linearise."""
    cov = predict(Gaussian(state["before"], state["cov"]), motion, inputs["dt"]).cov
    now = Gaussian(inputs["now"], cov)
    plot, components = sensor.independent(inputs["z"], motion)
    for component, measured in zip(components, plot, strict=True):
        _, h = gradient(component.value, inputs["now"])
        there = select(missing(measured), 0.0, 1.0)
        now, _ = condition(now, h, 0.0, component.sigma * component.sigma, there)
    return {"before": inputs["now"], "cov": now.cov}, {"cov": now.cov}


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

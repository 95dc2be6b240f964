"""How well any filter could do: the Cramer-Rao bound, along each trajectory and on average.

[tichavsky1998] P. Tichavsky, C. H. Muravchik and A. Nehorai, "Posterior Cramer-Rao Bounds for
Discrete-Time Nonlinear Filtering"; [taylor1979] J. H. Taylor, "The Cramer-Rao Estimation Error
Lower Bound Computation for Deterministic Nonlinear Systems"; [hernandez2004] M. L. Hernandez,
B. Ristic, A. Farina and L. Timmoneri, "A Comparison of Two Cramer-Rao Bounds for Nonlinear
Filtering with Pd < 1".
Differs from them: in covariance form, because G Q G' is singular and has no inverse. Along one
trajectory the bound's recursion is then the extended Kalman filter's, linearised at the truth.

Which average: the expectation of the information over random trajectories (`bound_averaged`,
[tichavsky1998]) is dominated by the few that pass near the sensor (for an azimuth it diverges
logarithmically) and says little about a typical run. `bound_per_trajectory` gives every
trajectory its own bound, and covariances are averaged.

Plots that are missing: a trajectory's own bound is that of the plots which its run had
([hernandez2004], enumeration); in the average, information is multiplied by the probability of
detection (their information reduction factor), which is never the larger bound. False plots take
information away too; here they take none, so with them both are lower than they need to be.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.metrics import ALL, elements
from boresight.experiments.simulate import Plots, Truth
from boresight.filters.ekf import condition
from boresight.filters.formula import Formula
from boresight.filters.kalman import predict
from boresight.lanes import Matrix, Rate, Scalar, Symmetric, Vector
from boresight.maths import Gaussian, gradient, jacobian, missing, select
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor

Array = Any
_ROUNDING = 1e-9  # of a Jacobian's or a noise's largest number


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


def bound_averaged(
    truth: Truth,
    prior: Gaussian,
    motion: Motion,
    sensor: Sensor,
    *,
    dt: Array,
    detection: Array | float = 1.0,
) -> Array:
    """Posterior Cramer-Rao bound with the information averaged over trajectories.

    Paper: tichavsky1998, (21), as P' = F (P⁻¹ + D)⁻¹ F' + Q, where F is the
    average Jacobian of the motion and D the average of δF' Q⁻¹ δF, δF being what a trajectory's own
    differs by. Where the motion is linear D is zero and Q may be singular.

    Args:
        truth: trajectories, over which is averaged.
        prior: of the state at `truth.start`: cov (n, n), or (runs, n, n), whose inverses are
            averaged.
        motion: how targets move.
        sensor: what sees them.
        dt: (1, scans), s before each scan.
        detection: probability that a scan has a plot, one for all or (scans,); 0 for scans whose
            plots made the prior.

    Returns:
        (scans, n, n) covariances, after each scan.

    Raises:
        UsageError: trajectories differ in how they move in a direction in which there is no noise.
    """
    scans = truth.states.shape[1]
    seen, F = _models_along(truth, motion, sensor, dt)
    information = np.mean(seen, axis=0) * np.broadcast_to(detection, scans)[:, None, None]
    cov, bounds = prior.cov, []
    if np.ndim(cov) > 2:
        cov = np.linalg.inv(np.mean(np.linalg.inv(cov), axis=0))
    for k in range(scans):
        noise = np.asarray(motion.noise(dt[0, k]), dtype=float)
        average, spread = _averaged_move(F[:, k], noise)
        cov = average @ _informed(cov, spread) @ average.T + noise
        cov = _informed(cov, information[k])
        bounds.append(cov)
    return np.stack(bounds)


def _models_along(truth: Truth, motion: Motion, sensor: Sensor, dt: Array) -> tuple[Array, Array]:
    """Information H' R⁻¹ H of a whole plot, and F of the step before it: (runs, scans, n, n)."""
    n = truth.states.shape[2]
    formula = Formula(
        step=_along_step,
        motion=motion,
        sensor=sensor,
        state=(("before", Vector(n)),),
        inputs=(("dt", Scalar(), Rate.STEP), ("now", Vector(n), Rate.EACH)),
        outputs=(("seen", Matrix(n, n)), ("F", Matrix(n, n))),
    )
    inputs = {"dt": dt[0], "now": truth.states}
    found = formula.run({"before": truth.start}, inputs, truth.states.shape[1])
    return found["seen"], found["F"]


def _along_step(
    motion: Motion, sensor: Sensor, state: Mapping[str, Any], inputs: Mapping[str, Any]
) -> tuple[Any, Any]:
    """What a whole plot tells of one target, and how it moved."""
    _, F = jacobian(lambda x: motion.move(x, inputs["dt"]), state["before"])
    seen = 0.0
    _, components = sensor.independent(np.zeros(len(sensor.names)), motion)
    for component in components:
        _, h = gradient(component.value, inputs["now"])
        seen = seen + np.outer(h, h) / (component.sigma * component.sigma)
    return {"before": inputs["now"]}, {"seen": seen, "F": F}


def _averaged_move(F: Array, noise: Array) -> tuple[Array, Array]:
    """Average of F (runs, n, n), and of δF' Q⁻¹ δF."""
    difference = F - F[0]
    off = np.mean(difference, axis=0)
    if not difference.any():
        return F[0], np.zeros_like(off)
    difference = difference - off
    values, vectors = np.linalg.eigh(noise)
    noisy = values > _ROUNDING * values[-1]
    across = np.abs(vectors[:, ~noisy].T @ difference)
    if across.max(initial=0.0) > _ROUNDING * np.abs(F).max():
        raise UsageError(
            "no bound averaged in information",
            why="trajectories differ in how they move where the motion has no noise",
            next_step="use the bound of each trajectory",
        )
    white = vectors[:, noisy].T @ difference / np.sqrt(values[noisy])[:, None]
    return F[0] + off, np.mean(np.swapaxes(white, 1, 2) @ white, axis=0)


def _informed(cov: Array, information: Array) -> Array:
    """(cov⁻¹ + information)⁻¹, where cov may be singular."""
    found = np.linalg.solve(np.eye(len(cov)) + cov @ information, cov)
    return (found + found.T) / 2


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

"""How long does a range-parameterised bank take, beside plain NumPy and Stone Soup?

200 runs of the paper's 801 bearings through six EKF cells, weighted, pruned and told by mean and
covariance after every bearing. NumPy does the same three times, and its means must agree with ours:
as a researcher writes it down first, for one run, with vectors (4,) and matrices (4, 4) in loops
over time and cells; with all runs and cells in one array, so that only the loop over time is left,
by the paper's formulas, Joseph's form (ix) among them, which is the arithmetic that ours does; and
that again with the algebra of a single bearing done by hand, without Joseph's form. Stone Soup has
no such bank: its bearings-only EKF filters one run, and is held to our `ekf`. Times are CPU time of
one thread, taken in turn in one process.
"""

import os
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import boresight as bs
from boresight.experiments.scenario import lookup
from boresight.experiments.simulate import simulate
from boresight.filters.start import on_bearing
from measure import at_least, at_most, interleaved, machine, publish, version

Array = Any
RUNS, SEED, ROUNDS, CELLS, PRUNE, SPEED = 200, 5, 9, 6, 1e-3, 11.0
SHORT = 120  # steps of Stone Soup's timed run
PARTICLES, PARTICLE_RUNS = 8_000, 1
WORLD = lookup("pradeep")
OWN = WORLD.sensor.pose.position_m[0, :, :2]
STEPS, SIGMA = len(OWN), np.radians(0.33)
ONE, ALL, HAND = "NumPy, one run", "NumPy, all runs", "NumPy, all runs, by hand"
SOUP = "stonesoup ekf, one run"
# Of the largest coordinate; Stone Soup takes numeric Jacobians.
TOLERANCE = {ONE: 1e-9, ALL: 1e-9, HAND: 1e-9, SOUP: 1e-5}
LIMIT_S, TIMES = 0.15, 50.0
REPEATS = 40  # of ours, so that its timed run is as long as NumPy's, on caches as warm


def cells() -> tuple[Array, Array]:
    """Middle and spread of each cell's range."""
    edges = np.geomspace(1_000.0, 20_000.0, CELLS + 1)
    return (edges[1:] + edges[:-1]) / 2.0, np.diff(edges) / np.sqrt(12.0)


def begin(bearing: float) -> tuple[Array, Array]:
    """Means (cells, 4) and covariances (cells, 4, 4) on a first bearing."""
    c, s = np.cos(bearing), np.sin(bearing)
    turn = np.array([[c, -s], [s, c]])
    means, covs = np.zeros((CELLS, 4)), np.zeros((CELLS, 4, 4))
    for i, (r, sd) in enumerate(zip(*cells(), strict=True)):
        means[i, :2] = r * c, r * s
        covs[i, :2, :2] = turn @ np.diag([sd**2, (r * SIGMA) ** 2]) @ turn.T
        covs[i, 2:, 2:] = SPEED**2 * np.eye(2)
    return means, covs


def wrap(angle: Array) -> Array:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def advance(dt: float) -> Array:
    F = np.eye(4)
    F[0, 2] = F[1, 3] = dt
    return F


def plain(z: Array, dt: Array, bearing: float) -> tuple[Array, Array]:
    """One run of bearings (steps,): mean (steps, 4) and cov (steps, 4, 4) of the bank."""
    x, P = begin(bearing)
    weights = np.full(CELLS, 1.0 / CELLS)
    means, covs = np.empty((len(z), 4)), np.empty((len(z), 4, 4))
    for k, measured in enumerate(z):
        F = advance(dt[k])
        logs = np.zeros(CELLS)
        for i in range(CELLS):
            x[i] = F @ x[i]
            P[i] = F @ P[i] @ F.T
            if np.isnan(measured):
                continue
            north, east = x[i, :2] - OWN[k]
            square = north**2 + east**2
            H = np.array([-east / square, north / square, 0.0, 0.0])
            S = H @ P[i] @ H + SIGMA**2
            K = P[i] @ H / S
            nu = wrap(measured - np.arctan2(east, north))
            x[i] = x[i] + K * nu
            A = np.eye(4) - np.outer(K, H)
            P[i] = A @ P[i] @ A.T + np.outer(K, K) * SIGMA**2
            logs[i] = -0.5 * (nu**2 / S + np.log(2.0 * np.pi * S))
        weights = weights * np.exp(logs - logs.max())
        weights /= weights.sum()
        weights[weights < PRUNE] = 0.0
        weights /= weights.sum()
        means[k] = weights @ x
        apart = x - means[k]
        covs[k] = sum(w * (p + np.outer(d, d)) for w, p, d in zip(weights, P, apart, strict=True))
    return means, covs


Update = Callable[[Array, Array], tuple[Array, Array, Array]]


def as_printed(P: Array, H: Array) -> tuple[Array, Array, Array]:
    """Gain, variance of the innovation and covariance: (vii) and (ix), for P (..., 4, 4)."""
    H = H[..., None, :]
    S = H @ P @ H.mT + SIGMA**2
    K = P @ H.mT / S
    A = np.eye(4) - K @ H
    return K[..., 0], S[..., 0, 0], A @ P @ A.mT + SIGMA**2 * K @ K.mT


def by_hand(P: Array, H: Array) -> tuple[Array, Array, Array]:
    """The same for a bearing, which sees the position only, without Joseph's form."""
    PH = (P[..., :2] @ H[..., :2, None])[..., 0]
    S = np.sum(H[..., :2] * PH[..., :2], axis=-1) + SIGMA**2
    K = PH / S[..., None]
    return K, S, P - PH[..., :, None] * K[..., None, :]


def vectorised(z: Array, dt: Array, bearings: Array, update: Update) -> tuple[Array, Array]:
    """All runs (runs, steps): mean (runs, steps, 4) and cov (runs, steps, 4, 4) of the bank."""
    x, P = (np.stack(each) for each in zip(*map(begin, bearings), strict=True))
    runs, steps = z.shape
    weights = np.full((runs, CELLS), 1.0 / CELLS)
    means, covs = np.empty((runs, steps, 4)), np.empty((runs, steps, 4, 4))
    H = np.zeros_like(x)
    for k in range(steps):
        F = advance(dt[k])
        x, P = x @ F.T, F @ P @ F.T
        if not np.isnan(z[:, k]).any():
            north, east = x[..., 0] - OWN[k, 0], x[..., 1] - OWN[k, 1]
            square = north**2 + east**2
            H[..., 0], H[..., 1] = -east / square, north / square
            K, S, P = update(P, H)
            nu = wrap(z[:, k, None] - np.arctan2(east, north))
            x = x + K * nu[..., None]
            logs = -0.5 * (nu**2 / S + np.log(2.0 * np.pi * S))
            weights = weights * np.exp(logs - logs.max(axis=1, keepdims=True))
            weights /= weights.sum(axis=1, keepdims=True)
            weights[weights < PRUNE] = 0.0
            weights /= weights.sum(axis=1, keepdims=True)
        means[:, k] = np.einsum("rc,rci->ri", weights, x)
        apart = x - means[:, k, None]
        covs[:, k] = np.einsum("rc,rcij->rij", weights, P)
        covs[:, k] += (weights[..., None] * apart).mT @ apart
    return means, covs


def stonesoup(start: bs.Gaussian) -> Callable[[Array], Array]:
    """Stone Soup's EKF with its bearing model where own ship was, made beforehand for each step."""
    from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor
    from stonesoup.types.angle import Bearing
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState, StateVector
    from stonesoup.updater.kalman import ExtendedKalmanUpdater

    motion = LinearGaussianTimeInvariantTransitionModel(
        transition_matrix=advance(1.0), covariance_matrix=np.zeros((4, 4))
    )
    models = [
        Cartesian2DToBearing(
            ndim_state=4,
            mapping=np.array([0, 1]),
            noise_covar=np.array([[SIGMA**2]]),
            translation_offset=StateVector(own),
        )
        for own in OWN
    ]
    predictor, updater = ExtendedKalmanPredictor(motion), ExtendedKalmanUpdater(None)
    begun = datetime(2026, 1, 1)  # noqa: DTZ001 - Stone Soup's times are naive

    def run(z: Array) -> Array:
        state = GaussianState(start.mean[0][:, None], start.cov[0], timestamp=begun)
        means = np.empty((len(z), 4))
        for k, (measured, model) in enumerate(zip(z, models[1:], strict=False), start=1):
            when = begun + timedelta(seconds=k)
            plot = np.array([[Bearing(measured)]], dtype=object)
            prior = predictor.predict(state, timestamp=when)
            seen = Detection(plot, timestamp=when, measurement_model=model)
            state = updater.update(SingleHypothesis(prior, seen))
            means[k - 1] = np.asarray(state.mean, dtype=float).ravel()
        return means

    return run


def apart(name: str, theirs: Array, ours: Array) -> float:
    """How far their means lie from ours; stops where it is more than stated."""
    found = float(np.abs(theirs - ours).max() / np.abs(ours).max())
    if not found <= TOLERANCE[name]:
        raise SystemExit(f"{name} does not solve the same problem: {found:.1e} apart")
    return found


def main() -> None:
    _, plots = simulate(WORLD, runs=RUNS, seed=SEED)
    z, dt = plots.z[..., 0], plots.dt[0]
    bearings = np.arctan2(plots.prior.mean[:, 1], plots.prior.mean[:, 0])
    models = WORLD.motion, WORLD.sensor
    single = on_bearing(bearings[:, None], *models, 10_500.0, 5_485.0, speed_mps=SPEED)
    cloud = bs.bearing_particles(
        bearings[:PARTICLE_RUNS, None], *models, speed_mps=SPEED, count=PARTICLES, seed=SEED
    )

    def bank() -> Any:
        return bs.run("rp-ekf", *models, plots, outputs=("mean", "cov"))

    def ekf() -> Any:
        return bs.run("ekf", *models, plots, start=single, outputs=("mean", "cov"))

    def repeated(task: Callable[[], Any]) -> Callable[[], None]:
        def several() -> None:
            for _ in range(REPEATS):
                task()

        return several

    tasks: dict[str, Callable[[], Any]] = {
        "boresight.run rp-ekf": repeated(bank),
        "boresight.run ekf": repeated(ekf),
        "particle_filter": lambda: bs.particle_filter(
            plots.z[:PARTICLE_RUNS], *models, plots.dt, cloud, seed=SEED
        ),
        ONE: lambda: plain(z[0], dt, bearings[0]),
        ALL: lambda: vectorised(z, dt, bearings, as_printed),
        HAND: lambda: vectorised(z, dt, bearings, by_hand),
    }
    ours = bank()
    differences = {name: apart(name, tasks[name]()[0], ours.mean) for name in (ALL, HAND)}
    differences[ONE] = apart(ONE, tasks[ONE]()[0], ours.mean[0])
    if version("stonesoup"):
        peer, heard = stonesoup(single), slice(1, SHORT + 1)
        differences[SOUP] = apart(SOUP, peer(z[0, heard]), ekf().mean[0, heard])
        tasks[SOUP] = lambda: peer(z[0, heard])
    units = dict.fromkeys(tasks, RUNS * STEPS) | {
        "boresight.run rp-ekf": REPEATS * RUNS * STEPS,
        "boresight.run ekf": REPEATS * RUNS * STEPS,
        "particle_filter": PARTICLE_RUNS * PARTICLES * STEPS,
        ONE: STEPS,
        SOUP: SHORT,
    }
    times = interleaved(tasks, rounds=ROUNDS)
    median = {name: value["median"] / units[name] for name, value in times.items()}
    report(times, median, differences)


def report(times: dict[str, Any], median: dict[str, float], differences: dict[str, float]) -> None:
    """Publish; medians are seconds a run and step."""
    bank = median["boresight.run rp-ekf"]
    targets = {
        "CPU s of 200 runs, 801 bearings, six cells": at_most(
            times["boresight.run rp-ekf"]["median"] / REPEATS, LIMIT_S
        )
    }
    for name in (ONE, ALL):
        targets[f"times faster than {name}"] = at_least(median[name] / bank, TIMES)
    ratios = {"boresight.run rp-ekf over NumPy by hand": median[HAND] / bank}
    if SOUP in median:
        ratios["boresight.run ekf over Stone Soup's"] = median[SOUP] / median["boresight.run ekf"]
        ratios["boresight.run rp-ekf, six cells, over Stone Soup's one"] = median[SOUP] / bank
    publish(
        "bearings_only",
        {
            "question": "CPU time of 200 runs of 801 bearings with six cells, and against others",
            "machine": machine("stonesoup"),
            "runs": RUNS,
            "steps": STEPS,
            "cpu_s": times,
            "repeats_of_ours_in_cpu_s": REPEATS,
            "ns_a_run_and_step": {name: 1e9 * value for name, value in median.items()},
            "particles": PARTICLES,
            "relative_difference_from_ours": {"is": differences, "at_most": TOLERANCE},
            "times_faster_a_step": ratios,
            "targets": targets,
        },
    )


if __name__ == "__main__":
    main()

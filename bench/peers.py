"""How long do others take? The same six-state radar problem in the packages people use today.

Every peer runs the joint extended Kalman filter on the same plots; its means must agree with those
of our `ekf` before it is timed. Ours is the sequential MEKF, which does somewhat more. Stone Soup's
unscented filter is held to our `ukf`. All run in
turn in one process; times are CPU time of predict and update together, one thread.

Stone Soup, filterpy and nrl-tracker filter one track at a time: their time for 1,000 runs is that
of one run. dynamax filters all runs at once (jit of vmap), twice: as it comes, with the means and
covariances of prediction and update, and with the updated means alone, which is all that ours
writes here.
"""

import os
from collections.abc import Callable, Iterator
from datetime import datetime, timedelta
from typing import Any

os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)

import numpy as np

import boresight as bs
from boresight.lanes import make_kernel, to_blocks
from kernels import recorded, started
from measure import at_least, interleaved, machine, publish, version
from scenario import DT, RADAR, SIGMA, SPATIAL, Scenario, straight

Array = Any
RUNS, STEPS, ROUNDS = 1000, 500, 15
LONG, SHORT = 500, 60  # steps of one timed run: fast and slow peers
REPEATS = 20  # of a streamed track, so that its timed run is as long as the peers'
PASSES = 10  # of our 1,000 runs: 11 ms alone are spent on the caches that a peer has left behind
F = np.kron(np.array([[1.0, DT], [0.0, 1.0]]), np.eye(3))
Q = SPATIAL.noise(DT)
R = np.diag(SIGMA**2)
UNSCENTED = {"alpha": 1.0, "beta": 2.0, "kappa": 0.0}  # our defaults
# Relative to the largest coordinate. Stone Soup takes numeric Jacobians and averages sines and
# cosines of angles; dynamax adds a jitter.
TOLERANCE = {
    "stonesoup": 1e-5,
    "stonesoup ukf": 1e-5,
    "filterpy": 1e-10,
    "nrl-tracker": 1e-10,
    "dynamax": 1e-4,
}
# How many times faster we must be.
KERNEL = {"filterpy": 1_500, "stonesoup": 30_000, "dynamax": 50, "dynamax, means only": 50}
UKF = {"stonesoup ukf": 3_000}
STREAM = {"filterpy": 10, "stonesoup": 250}


def measure(x: Array) -> Array:
    """Range, azimuth and elevation of a state (6,)."""
    flat = np.hypot(x[0], x[1])
    return np.array([np.hypot(flat, x[2]), np.arctan2(x[1], x[0]), np.arctan2(x[2], flat)])


def jacobian(state: Array) -> Array:
    """Derivative (3, 6) of `measure`."""
    x, y, z = state[:3]
    flat2 = x * x + y * y
    flat, r2 = np.sqrt(flat2), flat2 + z * z
    r = np.sqrt(r2)
    H = np.zeros((3, 6))
    H[0, :3] = x / r, y / r, z / r
    H[1, :2] = -y / flat2, x / flat2
    H[2, :3] = -x * z / (r2 * flat), -y * z / (r2 * flat), flat / r2
    return H


Peer = Callable[[Array, Scenario], Array]  # plots (steps, 3) of one run -> means (steps, 6)


def filterpy(z: Array, given: Scenario) -> Array:
    """Filterpy's ExtendedKalmanFilter."""
    from filterpy.kalman import ExtendedKalmanFilter

    ekf = ExtendedKalmanFilter(dim_x=6, dim_z=3)
    ekf.x, ekf.P = given.start.mean.copy(), given.start.cov.copy()
    ekf.F, ekf.Q, ekf.R = F, Q, R
    means = np.empty((len(z), 6))
    for t, plot in enumerate(z):
        ekf.predict()
        ekf.update(plot, jacobian, measure)
        means[t] = ekf.x
    return means


def nrl_tracker(z: Array, given: Scenario) -> Array:
    """nrl-tracker's ekf_predict and ekf_update."""
    from pytcl.dynamic_estimation.kalman import ekf_predict, ekf_update

    x, P = given.start
    means = np.empty((len(z), 6))
    for t, plot in enumerate(z):
        prior = ekf_predict(x, P, lambda s: F @ s, F, Q)
        post = ekf_update(prior.x, prior.P, plot, measure, jacobian(prior.x), R)
        x, P = post.x, post.P
        means[t] = x
    return means


def stonesoup(*, unscented: bool = False) -> Peer:
    """Stone Soup's extended or unscented predictor and updater with its own radar model."""
    from stonesoup.models.measurement.nonlinear import CartesianToElevationBearingRange
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor, UnscentedKalmanPredictor
    from stonesoup.types.angle import Bearing, Elevation
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import ExtendedKalmanUpdater, UnscentedKalmanUpdater

    motion = LinearGaussianTimeInvariantTransitionModel(transition_matrix=F, covariance_matrix=Q)
    model = CartesianToElevationBearingRange(
        ndim_state=6, mapping=np.array([0, 1, 2]), noise_covar=np.diag(SIGMA[[2, 1, 0]] ** 2)
    )
    predictor, updater = ExtendedKalmanPredictor(motion), ExtendedKalmanUpdater(model)
    if unscented:
        predictor = UnscentedKalmanPredictor(motion, **UNSCENTED)
        updater = UnscentedKalmanUpdater(model, **UNSCENTED)
    begin = datetime(2026, 1, 1)  # noqa: DTZ001 - Stone Soup's times are naive

    def run(z: Array, given: Scenario) -> Array:
        state = GaussianState(given.start.mean[:, None], given.start.cov, timestamp=begin)
        means = np.empty((len(z), 6))
        for t, (r, az, el) in enumerate(z):
            when = begin + timedelta(seconds=DT * (t + 1))
            plot = np.array([[Elevation(el)], [Bearing(az)], [r]], dtype=object)
            prior = predictor.predict(state, timestamp=when)
            seen = Detection(plot, timestamp=when, measurement_model=model)
            state = updater.update(SingleHypothesis(prior, seen))
            means[t] = np.asarray(state.mean, dtype=float).ravel()
        return means

    return run


def dynamax(given: Scenario) -> Callable[[Array], Array]:
    """Dynamax's extended_kalman_filter over all runs at once; compiled when first called."""
    import jax
    import jax.numpy as jnp
    from dynamax.nonlinear_gaussian_ssm import ParamsNLGSSM, extended_kalman_filter

    jax.config.update("jax_enable_x64", val=True)
    f, q, r = jnp.array(F), jnp.array(Q), jnp.array(R)

    def polar(x: Array) -> Array:
        flat = jnp.hypot(x[0], x[1])
        return jnp.stack([jnp.hypot(flat, x[2]), jnp.arctan2(x[1], x[0]), jnp.arctan2(x[2], flat)])

    model = ParamsNLGSSM(
        initial_mean=jnp.array(F @ given.start.mean),  # dynamax updates before it predicts
        initial_covariance=jnp.array(F @ given.start.cov @ F.T + Q),
        dynamics_function=lambda x: f @ x,
        dynamics_covariance=q,
        emission_function=polar,
        emission_covariance=r,
    )

    whole = jax.jit(jax.vmap(lambda z: extended_kalman_filter(model, z)))
    means = jax.jit(
        jax.vmap(lambda z: extended_kalman_filter(model, z, output_fields=["filtered_means"]))
    )
    return lambda z: jax.block_until_ready(whole(z)), lambda z: jax.block_until_ready(means(z))


def singles() -> Iterator[tuple[str, Peer, int]]:
    """Peers that filter one track at a time, with the steps of one timed run."""
    if version("filterpy"):
        yield "filterpy", filterpy, LONG
    if version("nrl-tracker"):
        yield "nrl-tracker", nrl_tracker, LONG
    if version("stonesoup"):
        yield "stonesoup", stonesoup(), SHORT


def distance(name: str, means: Array, ours: Array) -> float:
    """How far a peer's means lie from our ekf's; stops where it is more than stated."""
    apart = float(np.abs(means - ours).max() / np.abs(ours).max())
    if not apart <= TOLERANCE[name]:
        raise SystemExit(f"{name} does not solve the same problem: {apart:.1e} apart")
    return apart


def kernel(name: str, given: Scenario) -> Callable[[], Any]:
    """A filter's kernel on blocked plots, the means of every step into an array kept for them."""
    program, values = recorded(name)
    ready, states = make_kernel(program, rows=False), started(program, given)
    inputs = values | {"dt": DT, "z": to_blocks(given.z)}
    kept = ready.run(states, inputs, STEPS)[1]
    return lambda: ready.run(states, inputs, STEPS, out=kept)


def passes(task: Callable[[], Any]) -> Callable[[], Any]:
    """The same task PASSES times."""

    def run() -> None:
        for _ in range(PASSES):
            task()

    return run


def live(given: Scenario, rows: bool) -> Callable[[], Any]:  # noqa: FBT001 - one flag
    """One track through the public streaming call, plot by plot."""
    step = bs.stream("mekf", SPATIAL, RADAR)
    plots = list(given.z[0]) if rows else given.z[0].tolist()

    def run() -> Any:
        for _ in range(REPEATS):
            state = step.start(given.start)
            for plot in plots:
                state = step(state, plot, dt=DT)
        return state

    return run


def main() -> None:
    given = straight(RUNS, STEPS)
    start = {"dt": DT, "start": given.start, "outputs": ("mean",)}
    ours = bs.run("ekf", SPATIAL, RADAR, given.z, **start).mean
    apart: dict[str, float] = {}
    tasks: dict[str, Callable[[], Any]] = {
        "mekf kernel": passes(kernel("mekf", given)),
        "ukf kernel": passes(kernel("ukf", given)),
        "boresight.run mekf": passes(lambda: bs.run("mekf", SPATIAL, RADAR, given.z, **start)),
        "boresight.stream mekf, arrays": live(given, rows=True),
        "boresight.stream mekf, lists": live(given, rows=False),
    }
    per = dict.fromkeys(tasks, REPEATS * STEPS) | dict.fromkeys(
        list(tasks)[:3], PASSES * RUNS * STEPS
    )
    for name, peer, steps in singles():
        apart[name] = distance(name, peer(given.z[0, :steps], given), ours[0, :steps])
        tasks[name] = lambda peer=peer, steps=steps: peer(given.z[0, :steps], given)
        per[name] = steps
    if version("stonesoup"):
        peer = stonesoup(unscented=True)
        ukf = bs.run("ukf", SPATIAL, RADAR, given.z[:1, :SHORT], **start).mean[0]
        apart["stonesoup ukf"] = distance("stonesoup ukf", peer(given.z[0, :SHORT], given), ukf)
        tasks["stonesoup ukf"] = lambda peer=peer: peer(given.z[0, :SHORT], given)
        per["stonesoup ukf"] = SHORT
    if version("dynamax"):
        whole, means = dynamax(given)
        apart["dynamax"] = distance("dynamax", np.asarray(whole(given.z).filtered_means), ours)
        tasks["dynamax"] = lambda: whole(given.z)
        tasks["dynamax, means only"] = lambda: means(given.z)
        per |= dict.fromkeys(("dynamax", "dynamax, means only"), RUNS * STEPS)
    times = interleaved(tasks, rounds=ROUNDS, per={n: p * 1e-9 for n, p in per.items()})
    publish(
        "peers",
        {
            "question": "CPU ns per predict and update of a six-state radar filter",
            "machine": machine(*apart, "jax"),
            "runs": RUNS,
            "steps": STEPS,
            "ns_per_step": times,
            "relative_difference_from_ours": {"is": apart, "at_most": TOLERANCE},
            "targets": ratios(times, "mekf kernel", KERNEL)
            | ratios(times, "boresight.run mekf", KERNEL)
            | ratios(times, "ukf kernel", UKF)
            | ratios(times, "boresight.stream mekf, arrays", STREAM),
        },
    )


def ratios(times: dict[str, Any], ours: str, targets: dict[str, int]) -> dict[str, Any]:
    """How many times faster we are, by medians, against what is asked."""
    return {
        f"{ours}, times faster than {name}": at_least(
            times[name]["median"] / times[ours]["median"], target
        )
        | {"of_minima": times[name]["min"] / times[ours]["min"]}
        for name, target in targets.items()
        if name in times
    }


if __name__ == "__main__":
    main()

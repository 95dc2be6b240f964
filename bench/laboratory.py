"""What does a study cost? Random numbers, truth, plots, filter and metrics, all of it counted.

End to end: a chunk of a study of six states and a radar of range, azimuth and elevation, with every
metric of each scan that a study has by default. The rival is the same work in JAX: its own random
numbers, truth and plots, dynamax's extended Kalman filter, RMSE and NEES of each scan, all runs at
once and compiled as a whole (jit of vmap). dynamax does not wrap angles, so both see a target that
no azimuth wraps for. Times are CPU time of one thread, interleaved in one process.

Scaling: CPU time against runs and against steps, and the memory of the largest study in a process
of its own. `python bench/laboratory.py memory` is that process.
"""

import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)

import numpy as np

from boresight import catalogue
from boresight.experiments.scenario import Scenario, lookup
from boresight.laboratory.gather import Tally
from boresight.laboratory.run import run_study
from boresight.laboratory.scores import Gathered
from boresight.laboratory.study import Contender, Setting, Study
from boresight.laboratory.trial import run_chunk
from measure import at_least, at_most, interleaved, machine, publish, version
from scenario import DT, RADAR, SPATIAL

Array = Any
RUNS, STEPS, ROUNDS, CHUNK = 1024, 500, 15, 2048
PASSES = 8  # of our runs: 10 ms alone are spent on the caches that the rival has left behind
LARGE = 1_000_000
RUNS_COUNTED = (1_000, 10_000, 100_000, LARGE)  # of STEPS steps
STEPS_COUNTED = (1_000, 10_000, 100_000, LARGE)  # of 512 runs
PICTURE = Path(__file__).parent.parent / "docs" / "laboratory-cost.png"
PAPER = lookup("kashyap-set-2")
AWAY = Scenario(
    name="away",
    motion=SPATIAL,
    sensor=RADAR,
    initial=[10e3, 5e3, 3e3, 100.0, 50.0, 5.0],
    prior_cov=np.diag([300.0**2] * 3 + [30.0**2] * 3),
    dt_s=DT,
    scans=STEPS,
)


def study_of(scenario: Scenario, name: str, runs: int) -> Study:
    """One filter in one world, with the usual metrics."""
    models = {"motion": scenario.motion, "sensor": scenario.sensor}
    contender = Contender(label=name, filter=catalogue.lookup(name), **models)
    setting = Setting(scenario=scenario, contenders=(contender,))
    return Study(name="cost", settings=(setting,), runs=runs, seed=1)


def gathered(study: Study) -> Gathered:
    """All runs, in chunks one after the other."""
    (setting,) = study.settings
    tally = Tally(study.runs)
    for first in range(0, study.runs, CHUNK):
        count = min(CHUNK, study.runs - first)
        tally.add(run_chunk(study, setting, setting.contenders[0], first, count))
    return tally.gathered()


def dynamax() -> Callable[[int], tuple[Array, Array]]:
    """Seed to mean squared position error and mean NEES of each scan, over all runs."""
    import jax
    import jax.numpy as jnp
    from dynamax.nonlinear_gaussian_ssm import ParamsNLGSSM, extended_kalman_filter

    jax.config.update("jax_enable_x64", val=True)
    F = jnp.array(np.kron(np.array([[1.0, DT], [0.0, 1.0]]), np.eye(3)))
    G = jnp.array(np.kron(np.array([[DT * DT / 2.0], [DT]]), np.eye(3)) * SPATIAL.accel_mps2)
    sigma = jnp.array([RADAR.range_m, *np.radians([RADAR.azimuth_deg, RADAR.elevation_deg])])
    initial, cov = jnp.array(AWAY.initial), jnp.array(AWAY.prior_cov)

    def polar(x: Array) -> Array:
        flat = jnp.hypot(x[0], x[1])
        return jnp.stack([jnp.hypot(flat, x[2]), jnp.arctan2(x[1], x[0]), jnp.arctan2(x[2], flat)])

    def one(key: Array) -> tuple[Array, Array]:
        keys = jax.random.split(key, 3)
        pushes = jax.random.normal(keys[0], (STEPS - 1, 3)) @ G.T
        _, later = jax.lax.scan(lambda x, w: (F @ x + w,) * 2, initial, pushes)
        truth = jnp.concatenate([initial[None], later])
        z = jax.vmap(polar)(truth) + jax.random.normal(keys[1], (STEPS, 3)) * sigma
        drawn = initial + jnp.sqrt(jnp.diag(cov)) * jax.random.normal(keys[2], (6,))
        model = ParamsNLGSSM(drawn, cov, lambda x: F @ x, G @ G.T, polar, jnp.diag(sigma**2))
        wanted = ["filtered_means", "filtered_covariances"]
        post = extended_kalman_filter(model, z, output_fields=wanted)
        error = post.filtered_means - truth
        solved = jax.vmap(jnp.linalg.solve)(post.filtered_covariances, error[..., None])[..., 0]
        return jnp.sum(error[:, :3] ** 2, axis=1), jnp.sum(error * solved, axis=1) / 6.0

    @jax.jit
    def all_runs(key: Array) -> tuple[Array, Array]:
        square, nees = jax.vmap(one)(jax.random.split(key, RUNS))
        return jnp.mean(square, axis=0), jnp.mean(nees, axis=0)

    return lambda seed: jax.block_until_ready(all_runs(jax.random.key(seed)))


def agreement(rival: Callable[[int], tuple[Array, Array]]) -> dict[str, float]:
    """Position RMSE and ANEES of both; stops where they are not those of one problem."""
    sums = gathered(study_of(AWAY, "ekf", RUNS)).sums
    square, nees = rival(0)
    found = {
        "our rmse_m": np.sqrt(sums["position_sq_m2"].mean() / RUNS),
        "dynamax rmse_m": np.sqrt(np.mean(square)),
        "our anees": sums["nees"].mean() / RUNS,
        "dynamax anees": np.mean(nees),
    }
    for name in ("rmse_m", "anees"):
        if not abs(found[f"our {name}"] / found[f"dynamax {name}"] - 1.0) < 0.03:
            raise SystemExit(f"dynamax does not solve the same problem: {found}")
    return {name: float(value) for name, value in found.items()}


def cost(study: Study, seconds: float = 2.0) -> float:
    """CPU seconds of the study, the median of as many times as fit, three at least."""
    gathered(replace(study, runs=min(study.runs, 64)))
    times: list[float] = []
    while len(times) < 3 or sum(times) < seconds:
        start = time.process_time()
        gathered(study)
        times.append(time.process_time() - start)
        if sum(times) > 10.0 * seconds:
            break
    return float(np.median(times))


def scaling() -> dict[str, dict[int, float]]:
    """CPU ns of a step and run: against runs of 500 steps, and against steps of 512 runs."""
    by_runs = {n: cost(study_of(AWAY, "mekf", n)) * 1e9 / n / STEPS for n in RUNS_COUNTED}
    by_steps = {}
    for steps in STEPS_COUNTED:
        longer = replace(AWAY, scans=steps, name="long")
        by_steps[steps] = cost(study_of(longer, "mekf", 512)) * 1e9 / 512 / steps
    return {"runs": by_runs, "steps": by_steps}


def bend(costs: dict[int, float]) -> float:
    """Largest relative difference of the cost of a step from the middle of all."""
    values = np.array(list(costs.values()))
    return float(np.max(np.abs(values / np.median(values) - 1.0)))


def picture(costs: dict[str, dict[int, float]]) -> None:
    """CPU time against runs and against steps, with the straight line through the median cost."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(8.4, 3.4), sharey=True, layout="constrained")
    other = {"runs": STEPS, "steps": 512}
    for axis, (name, measured) in zip(axes, costs.items(), strict=True):
        n, each = np.array(list(measured)), np.array(list(measured.values())) * 1e-9
        axis.loglog(n, n * other[name] * np.median(each), color="0.75", label="linear")
        axis.loglog(n, n * other[name] * each, "o", color="#0072B2", label="measured")
        fixed = "steps each" if name == "runs" else "runs"
        axis.set(
            xlabel=f"{name} ({other[name]} {fixed})",
            title=f"{1e9 * np.median(each):.0f} ns a step and run",
        )
        axis.grid(visible=True, color="0.92")
    axes[0].set_ylabel("CPU time, s")
    axes[0].legend(frameon=False)
    figure.savefig(PICTURE, dpi=110)


def largest() -> None:
    """The largest study, alone in its process: peak memory in MB, and seconds of CPU."""
    begun = time.process_time()
    result = run_study(study_of(AWAY, "mekf", LARGE))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(peak, time.process_time() - begun, result.cells[0].position_rmse_m.value)


def main() -> None:
    alone = subprocess.run(  # first: a child's peak begins at what its parent holds
        [sys.executable, __file__, "memory"], capture_output=True, text=True, check=True
    )
    peak, seconds, _ = map(float, alone.stdout.split())
    names = {"kashyap-set-2": PAPER, "away": AWAY}
    tasks: dict[str, Callable[[], Any]] = {
        f"{name}, {world}": partial(gathered, study_of(scenario, name, PASSES * RUNS))
        for name in ("ekf", "mekf")
        for world, scenario in names.items()
    }
    per = dict.fromkeys(tasks, PASSES * RUNS * STEPS * 1e-9)
    solved: dict[str, float] = {}
    if version("dynamax"):
        rival = dynamax()
        solved = agreement(rival)
        tasks["dynamax, away"] = partial(rival, 1)
        per["dynamax, away"] = RUNS * STEPS * 1e-9
    times = interleaved(tasks, rounds=ROUNDS, per=per)
    targets = {
        f"{name}, CPU ns a step, end to end": at_most(times[name]["median"], 80.0)
        for name in ("ekf, kashyap-set-2", "mekf, kashyap-set-2")
    }
    if solved:
        ratio = times["dynamax, away"]["median"] / times["ekf, away"]["median"]
        targets["ekf, times faster than dynamax"] = at_least(ratio, 25)
    costs = scaling()
    picture(costs)
    targets["10^6 runs of 500 steps, MB"] = at_most(peak, 500.0)
    for name, measured in costs.items():
        targets[f"cost of a step against {name}, off linear"] = at_most(bend(measured), 0.1)
    publish(
        "laboratory",
        {
            "question": "CPU ns of a step of a study: draws, truth, plots, filter and metrics",
            "machine": machine("dynamax", "jax"),
            "runs": RUNS,
            "steps": STEPS,
            "ns_per_step": times,
            "solved": solved,
            "scaling_ns_per_step": costs,
            "largest": {"runs": LARGE, "steps": STEPS, "peak_MB": peak, "cpu_s": seconds},
            "targets": targets,
        },
    )


if __name__ == "__main__":
    if sys.argv[1:] == ["memory"]:
        largest()
    else:
        main()

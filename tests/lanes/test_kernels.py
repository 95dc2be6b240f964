"""Every catalogue filter as machine code: each back end near the floats, each lane count exact."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.filters.recursion import OUTPUTS, leaves, run_recursion
from boresight.lanes import (
    Matrix,
    Rate,
    Scalar,
    Symbol,
    Vector,
    from_blocks,
    make_kernel,
    pack_states,
    to_blocks,
    trace,
)
from boresight.maths import Gaussian, gradient
from boresight.models.parameters import rate_of
from boresight.models.sensors import Pose
from boresight.testing.worlds import tilted
from lanes.machines import COMPILED, EVERY, compiled_targets, kernel_for, name_of, targets
from laws.enrolled import (
    BEARING_WORLDS,
    BY_EAR,
    CURVED,
    FILTERS,
    LINEAR_WORLDS,
    POLAR,
    POLAR_WORLDS,
    SPACE,
    World,
)

PAIRS = [
    pytest.param(entry, world, id=f"{entry}-{world}")
    for entries, world in (
        ([e for e in FILTERS if not e.curved], LINEAR_WORLDS[0]),
        (CURVED, POLAR_WORLDS[0]),
        (BY_EAR, BEARING_WORLDS[0]),
    )
    for entry in entries
]
everyone = pytest.mark.parametrize(("entry", "world"), PAIRS)
STEPS = 5


@cache
def program_of(entry, world):
    """What `run_recursion` would compile for these worlds, every output wanted."""
    return program_for(entry.recursion(world))


def program_for(recursion):
    n, k = recursion.size
    rates = dict.fromkeys(recursion.models(), Rate.FIXED)
    shapes = {name: leaf for name, (_, leaf) in recursion.models().items()}
    inputs = {"z": (Vector(k), Rate.EACH), "dt": (Scalar(), Rate.FIXED)}
    inputs |= {name: (shapes[name], rate) for name, rate in rates.items()}
    full = {name: leaves(n, k)[name] for name in OUTPUTS} | {"cov": Matrix(n, n)}
    return trace(
        recursion.step,
        state=recursion.layout,
        inputs=inputs,
        outputs={name: (leaf, Rate.EACH) for name, leaf in full.items()},
    )


@cache
def flights(world, lanes):
    """Many starts and plots, quickly; one component in ten is missing."""
    mean, cov = world.prior(11)
    rng = np.random.default_rng(12)
    starts = mean + rng.normal(size=(lanes, len(mean))) * np.sqrt(np.diag(cov))
    plots = np.stack([[world.plot(m, (i, t)) for t in range(STEPS)] for i, m in enumerate(starts)])
    plots[rng.random(plots.shape) < 0.1] = np.nan
    return starts, np.tile(cov, (lanes, 1, 1)), plots


def run(kernel, entry, world, lanes, *, of=None, threads=1, flown=None):
    """Outputs and final state of the first `lanes` flights, or of those in `of`."""
    flown = flown or flights(world, lanes)
    mean, cov, z = (array if of is None else array[of] for array in flown)
    recursion = entry.recursion(world)
    values = {name: value for name, (value, _) in recursion.models().items()}
    states = recursion.states(Gaussian(mean, cov), len(mean))
    inputs = values | {"z": z if kernel.rows else to_blocks(z), "dt": 2.0}
    final, out = kernel.run(states, inputs, STEPS, threads=threads)
    return final.rows, out


@everyone
@targets
def test_every_back_end_is_the_formula_on_floats(goal, entry, world):
    lanes = 9
    _, out = run(kernel_for(program_of(entry, world), goal), entry, world, lanes)
    recursion = entry.recursion(world)
    mean, cov, z = flights(world, lanes)
    for lane in range(lanes):
        state = recursion.begin(mean[lane], cov[lane])
        for t in range(STEPS):
            state, results = recursion.step(state, {"z": z[lane, t], "dt": 2.0})
            for name in OUTPUTS:
                floats = np.asarray(results[name], dtype=float)
                size = np.nanmax(np.abs(floats), initial=1e-3)
                np.testing.assert_allclose(
                    out[name][lane, t], floats, rtol=1e-9, atol=1e-9 * size, err_msg=name
                )
                if name in ("mean", "cov"):  # well conditioned: next to nothing is lost
                    np.testing.assert_allclose(
                        out[name][lane, t], floats, atol=1e-11 * size, rtol=0
                    )


@everyone
def test_lanes_do_not_know_of_each_other(entry, world):
    """1, 2, 7, 8, 9 and 1,000 lanes, one thread and two: the same bits."""
    kernel = make_kernel(program_of(entry, world))
    final, out = run(kernel, entry, world, 1_000)
    both = run(kernel, entry, world, 1_000, threads=2)
    np.testing.assert_array_equal(both[0], final)
    for name in OUTPUTS:
        np.testing.assert_array_equal(both[1][name], out[name])
    for lanes in (1, 2, 7, 8, 9):
        of = slice(500, 500 + lanes)
        few_final, few = run(kernel, entry, world, 1_000, of=of)
        np.testing.assert_array_equal(few_final, final[of])
        for name in OUTPUTS:
            np.testing.assert_array_equal(few[name], out[name][of])


@compiled_targets
def test_lanes_do_not_know_of_each_other_on_any_target(goal):
    entry, world = CURVED[4], POLAR_WORLDS[0]
    kernel = kernel_for(program_of(entry, world), goal)
    final, out = run(kernel, entry, world, 1_000, threads=3)
    for lanes in (1, 2, 7, 8, 9):
        of = slice(500, 500 + lanes)
        few_final, few = run(kernel, entry, world, 1_000, of=of)
        np.testing.assert_array_equal(few_final, final[of])
        np.testing.assert_array_equal(few["cov"], out["cov"][of])


@everyone
def test_rows_and_blocks_have_the_same_bits(entry, world):
    program = program_of(entry, world)
    lanes = 19
    final, rows = run(make_kernel(program), entry, world, lanes)
    blocked_final, blocked = run(make_kernel(program, rows=False), entry, world, lanes)
    np.testing.assert_array_equal(final, blocked_final)
    for slot in program.outputs:
        values = slot.leaf.unpack(from_blocks(blocked[slot.name], lanes))
        np.testing.assert_array_equal(values, rows[slot.name])


@pytest.mark.parametrize("entry", CURVED, ids=str)  # the linear filter has no form without masks
def test_looking_for_missing_numbers_costs_no_bit_where_none_is_missing(entry, monkeypatch):
    """The same filter recorded without any mask. Compiled, other products fuse: 1e-12."""
    world = POLAR_WORLDS[0]
    masked, recursion = program_of(entry, world), entry.recursion(world)

    monkeypatch.setattr(Symbol, "isnan", lambda _: False)
    plain = program_for(recursion)
    assert plain.operations < masked.operations
    assert not any(op == "isnan" for op, _ in plain.nodes)
    mean, cov, z = flights(world, 9)
    there = mean, cov, np.where(np.isnan(z), 0.1, z)  # any number will do
    for goal, tolerance in ((None, 0.0), *((goal, 1e-12) for goal in COMPILED[:1])):
        results = [
            run(kernel_for(program, goal), entry, world, 9, flown=there)
            for program in (plain, masked)
        ]
        for name in ("mean", "cov", "nis", "loglik"):
            ours, theirs = (out[name] for _, out in results)
            np.testing.assert_allclose(
                ours, theirs, rtol=tolerance, atol=tolerance * np.max(np.abs(theirs))
            )


@everyone
def test_the_last_step_alone_is_the_last_of_all_steps(entry, world):
    mean, cov, z = flights(world, 9)
    recursion, start = entry.recursion(world), Gaussian(mean, cov)
    each = run_recursion(recursion, z, 2.0, start, outputs=OUTPUTS)
    last = run_recursion(recursion, z, 2.0, start, outputs=OUTPUTS, last=True)
    for name in OUTPUTS:
        np.testing.assert_array_equal(last.others[name], each.others[name][:, -1])
    np.testing.assert_array_equal(last.final.data, each.final.data)


SHAPES = {"fixed": (), "lane": (9, 1), "step": (1, STEPS), "each": (9, STEPS)}


def one_lane_at_a_time(entry, world, dt, mean, cov, z):
    """The formula on floats; whatever varies is looked up lane by lane and step by step."""

    def at(model, lane, t):
        changed = {}
        for name in model.__dataclass_fields__:
            value = getattr(model, name)
            if isinstance(value, np.ndarray) and value.ndim >= 2:
                shape = (9, STEPS, *value.shape[2:])
                changed[name] = np.broadcast_to(value, shape)[lane, t]
        return replace(model, **changed) if changed else model

    means = np.empty((*z.shape[:2], len(world.motion.names)))
    for lane in range(len(z)):
        state = {"mean": mean[lane], "cov": cov[lane]}
        for t in range(z.shape[1]):
            sensor = at(world.sensor, lane, t)
            if sensor.pose is not None:
                sensor = replace(sensor, pose=at_pose(sensor.pose, lane, t))
            now = World(at(world.motion, lane, t), sensor)
            gap = np.broadcast_to(dt, (9, STEPS))[lane, t]
            state, _ = entry.recursion(now).step(state, {"z": z[lane, t], "dt": gap})
            means[lane, t] = state["mean"]
    return means


def at_pose(pose, lane, t):
    def pick(value, size):
        return (
            np.broadcast_to(value, (9, STEPS, *size))[lane, t] if value.ndim > len(size) else value
        )

    return Pose(
        position_m=pick(pose.position_m, (3,)),
        rotation=pick(pose.rotation, (3, 3)),
        velocity_mps=pick(pose.velocity_mps, (3,)),
    )


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("what", ["dt", "accel_mps2", "range_m", "azimuth_deg", "pose"])
def test_what_is_declared_may_be_fixed_or_vary_by_lane_by_step_or_both(what, shape):
    rng = np.random.default_rng(2)
    dt, motion, sensor = 2.0, SPACE, POLAR
    if what == "dt":
        dt = rng.uniform(1, 5, shape) if shape else 3.0
    elif what == "accel_mps2":
        motion = replace(SPACE, accel_mps2=rng.uniform(1, 5, shape) if shape else 3.0)
    elif what == "pose":
        turns = np.array(
            [tilted(a, 0.2) for a in rng.uniform(-0.1, 0.1, max(1, np.prod(shape, dtype=int)))]
        )
        pose = Pose(
            position_m=rng.normal(size=(*shape, 3)) * 200.0,
            rotation=turns.reshape(*shape, 3, 3),
            velocity_mps=rng.normal(size=(*shape, 3)),
        )
        sensor = replace(POLAR, pose=pose)
    else:
        sigma = rng.uniform(0.5, 2.0, shape) * getattr(POLAR, what) if shape else 1.5
        sensor = replace(POLAR, **{what: sigma})
    world, entry = World(motion, sensor), CURVED[4]
    mean, cov, z = flights(World(SPACE, POLAR), 9)
    got = run_recursion(entry.recursion(world), z, dt, Gaussian(mean, cov), outputs=["mean"]).mean
    expected = one_lane_at_a_time(entry, world, dt, mean, cov, z)
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9 * np.max(np.abs(expected)))


def test_rates_are_read_off_shapes():
    leaf = Vector(3)
    for shape, rate in (
        ((3,), Rate.FIXED),
        ((9, 3), Rate.LANE),
        ((9, 1, 3), Rate.LANE),
        ((1, 5, 3), Rate.STEP),
        ((9, 5, 3), Rate.EACH),
        ((1, 1, 3), Rate.FIXED),
    ):
        assert rate_of("x", np.zeros(shape), leaf)[0] == rate


@pytest.mark.skipif(len(COMPILED) < 2, reason="this machine has one vector unit")
@everyone
def test_processors_that_fuse_have_the_same_bits(entry, world):
    fused = [goal for goal in COMPILED if goal.name in ("avx2", "avx512")]
    results = [run(kernel_for(program_of(entry, world), g), entry, world, 9)[0] for g in fused]
    for other in results[1:]:
        np.testing.assert_array_equal(other, results[0])


def test_this_machine_has_something_to_compare():
    assert EVERY[-1] is None
    assert {name_of(goal) for goal in EVERY} >= {"numpy"}


def test_gradients_run_in_a_kernel_where_azimuth_is_singular():
    """A target right overhead, at the sensor, and on the seam: finite, and equal to the floats."""
    world = World(SPACE, POLAR)
    entry = CURVED[4]
    mean = np.array([[0, 0, 8e3, 1, 2, 3], [0, 0, 0, 1, 2, 3], [-2e4, -0.0, 1e3, 1, 2, 3]], float)
    cov = np.tile(np.diag([1e4, 1e4, 1e4, 100, 100, 100.0]), (3, 1, 1))
    z = np.array([[8e3, 0.3, 1.5], [10.0, 0.3, 0.5], [2e4, -3.1, 0.05]])[:, None]
    got = run_recursion(entry.recursion(world), z, 0.0, Gaussian(mean, cov), outputs=OUTPUTS)
    assert np.isfinite(got.mean).all()
    for lane in range(3):
        state = {"mean": mean[lane], "cov": cov[lane]}
        expected, _ = entry.recursion(world).step(state, {"z": z[lane, 0], "dt": 0.0})
        size = np.max(np.abs(expected["mean"]))
        np.testing.assert_allclose(got.mean[lane, 0], expected["mean"], atol=1e-9 * size)
    value, slope = gradient(world.sensor.components(SPACE)[1].value, mean[0])
    assert (value, slope.any()) == (0.0, False)


@pytest.mark.parametrize("rows", [True, False])
def test_outputs_go_into_arrays_that_are_given_and_fit(rows):
    program = trace(
        lambda state, given: (
            {"x": state["x"] + given["z"]},
            {"y": state["x"] * given["z"]},
        ),
        state={"x": Vector(2)},
        inputs={"z": (Vector(2), Rate.EACH)},
        outputs={"y": (Vector(2), Rate.EACH)},
    )
    kernel = make_kernel(program, rows)
    z = np.random.default_rng(3).standard_normal((11, 4, 2))
    given = {"z": z if rows else to_blocks(z)}
    states = pack_states(program.state, {"x": np.ones((11, 2))})
    fresh = kernel.run(states, given, 4)[1]["y"]
    kept = {"y": np.full_like(fresh, np.nan)}
    again = kernel.run(states, given, 4, out=kept)[1]["y"]
    assert np.shares_memory(again, kept["y"])
    assert np.array_equal(kept["y"], fresh)
    for wrong in (kept["y"][:-1], kept["y"].astype("f4"), np.asfortranarray(kept["y"])):
        with pytest.raises(UsageError, match="does not fit"):
            kernel.run(states, given, 4, out={"y": wrong})

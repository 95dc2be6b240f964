"""Random numbers as formulas: the same numbers wherever they are made, and distributed as said.

Distribution tests look at some 60 figures, each at a false alarm of about 1e-6 (5 standard
deviations, or a p-value of 1e-6): 1 seed in 10,000 would fail one of them.
"""

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtr

from boresight.errors import UsageError
from boresight.lanes import Rate, Scalar, Vector, from_blocks, pack_states, trace
from boresight.maths import random, seeds
from boresight.maths.seeds import Stream
from lanes.machines import compiled_targets, kernel_for, targets

KEY, STREAM = random.key(5, "cell"), Stream.NOISE
RUNS, STEPS, COUNT = 4096, 64, 8  # 2.1 million numbers
extended = pytest.mark.skipif(
    np.finfo(np.longdouble).nmant < 60, reason="long double is no wider than double here"
)


def fused(goal, runs, *, threads=1, rows=True, name="drawn"):
    """Normal numbers of a kernel that also has other work to do: (runs, 4, 3)."""

    def step(state, inputs):
        counter = state["run"], inputs["step"]
        drawn, other = (random.normals(inputs["key"], *counter, int(s), 3) for s in (STREAM, 9))
        sums = state["sums"] + 0.3 * other
        return {"run": state["run"], "sums": sums}, {"drawn": drawn, "added": 2.5 + drawn}

    program = trace(
        step,
        state={"run": Scalar(), "sums": Vector(3)},
        inputs={"key": (Vector(2), Rate.FIXED), "step": (Scalar(), Rate.STEP)},
        outputs={name: (Vector(3), Rate.EACH)},
    )
    start = pack_states(program.state, {"run": runs, "sums": np.zeros((len(runs), 3))})
    kernel = kernel_for(program, goal, rows=rows)
    out = kernel.run(start, {"key": KEY, "step": np.arange(4.0)}, 4, threads=threads)[1][name]
    return out if rows else from_blocks(out, len(runs))


def test_floats_and_arrays_have_the_same_numbers():
    """(run, step) as a grid, and one by one."""
    grid = random.normals(KEY, np.arange(5.0)[:, None], np.arange(4.0), STREAM, 3)
    assert grid.shape == (3, 5, 4)
    for run, step in np.ndindex(5, 4):
        one = random.normals(KEY, float(run), float(step), STREAM, 3)
        np.testing.assert_allclose(one, grid[:, run, step], rtol=1e-15)
        assert np.array_equal(
            random.uniforms(KEY, float(run), float(step), STREAM, 3),
            random.uniforms(KEY, np.arange(5.0), float(step), STREAM, 3)[:, run],
        )


def test_fewer_are_the_first_of_more():
    few, many = (random.normals(KEY, 1.0, 2.0, STREAM, count) for count in (3, 8))
    assert np.array_equal(few, many[:3])


@targets
def test_a_kernel_makes_the_numbers_that_numpy_makes(goal):
    """To rounding: the bits are the same, the logarithm and the root may differ in the last."""
    want = random.normals(KEY, np.arange(9.0)[:, None], np.arange(4.0), STREAM, 3)
    np.testing.assert_allclose(fused(goal, np.arange(9.0)), np.moveaxis(want, 0, -1), rtol=1e-15)


def test_a_kernel_makes_the_numbers_of_seeds_to_the_last_bit():
    """Though it makes them in another order, beside other work, and adds to them."""
    goal = seeds._kernel().code and seeds._kernel().code.goal
    want = seeds.normals(5, "cell", STREAM, (4, 3), runs=9)
    assert np.array_equal(fused(goal, np.arange(9.0)), want)
    assert np.array_equal(fused(goal, np.arange(9.0), name="added"), 2.5 + want)


@targets
def test_no_lane_knows_of_the_others(goal):
    """Any number of lanes, any thread, any layout: run 7 is run 7."""
    many = fused(goal, np.arange(100.0))
    assert np.array_equal(fused(goal, np.arange(100.0), threads=5), many)
    assert np.array_equal(fused(goal, np.arange(100.0), rows=False), many)
    for lanes in (1, 7, 8, 9):
        assert np.array_equal(fused(goal, np.arange(lanes) + 3.0), many[3 : 3 + lanes])


@extended
@compiled_targets
def test_box_and_muller_in_extended_precision(goal):
    """Relative to the exact numbers of the same bits, near the zeros of sine and cosine too."""
    runs = np.arange(20_000.0)
    wide = np.longdouble
    for number in (0, 1):
        u, v = (
            x.astype(wide) for x in random.pair(KEY, runs[:, None], np.arange(4.0), STREAM, number)
        )
        turn = 2 * wide("3.14159265358979323846264338327950288") * (v - np.rint(4 * v) / 4)
        quarter, radius = np.rint(4 * v) % 4, np.sqrt(-2 * np.log(u))
        s, c = np.sin(turn), np.cos(turn)
        exact = [
            np.select([quarter == i for i in range(4)], x) for x in ((c, -s, -c, s), (s, c, -s, -c))
        ]
        drawn = fused(goal, runs)[..., 2 * number : 2 * number + 2]
        for i in range(drawn.shape[-1]):
            np.testing.assert_allclose(drawn[..., i] / (radius * exact[i]), 1.0, rtol=0, atol=1e-15)


def test_the_extreme_numbers_are_finite():
    """u at the ends of (0, 1), v at every eighth of a turn and beside it."""
    tiny = 2.0**-53
    u = np.array([tiny, 0.5, 1.0 - tiny])[:, None]
    eighths = np.arange(1, 8) / 8
    v = np.concatenate([eighths - tiny, eighths, eighths + tiny, [tiny, 1.0 - tiny]])
    x, y = random.normal_pair(u, v)
    np.testing.assert_allclose(np.hypot(x, y), np.sqrt(-2.0 * np.log(u)) + 0 * v, rtol=1e-15)
    np.testing.assert_allclose(np.arctan2(y, x) % (2 * np.pi), 2 * np.pi * v + 0 * u, atol=1e-15)
    assert np.max(np.hypot(x, y)) == pytest.approx(8.57, abs=0.01)


def test_keys_are_words_of_their_own():
    """Seeds to 2^64 - 1, and cells: 4,000 keys of 64 bits meet by chance once in 2e12."""
    seen = {random.key(seed, cell) for seed in (*range(1_000), 2**64 - 1) for cell in "abcd"}
    assert len(seen) == 4_004
    assert all(word == int(word) and 0 <= word < 2**32 for two in seen for word in two)


def test_runs_end_at_the_last_word():
    last = seeds.normals(1, "cell", STREAM, (2,), runs=1, first=2**32 - 1)
    assert np.array_equal(last, seeds.normals(1, "cell", STREAM, (2,), runs=5, first=2**32 - 5)[4:])
    with pytest.raises(UsageError, match=r"2\^32"):
        seeds.normals(1, "cell", STREAM, (2,), runs=2, first=2**32 - 1)


@pytest.mark.parametrize("shape", [(7,), (1, 7), (3, 1), (3, 2), (3, 2, 5), (0,), (2, 0)])
def test_numbers_of_any_shape(shape):
    """The first axis is the step, the rest is counted through."""
    drawn = seeds.normals(1, "cell", STREAM, shape, runs=2)
    assert drawn.shape == (2, *shape)
    steps, count = (shape[0], int(np.prod(shape[1:]))) if len(shape) > 1 else (1, shape[0])
    for run, step in np.ndindex(2, steps):
        want = random.normals(random.key(1, "cell"), float(run), float(step), STREAM, count)
        got = drawn[run].reshape(steps, count)[step]
        np.testing.assert_allclose(got, want, rtol=1e-15)


@pytest.fixture(scope="module")
def drawn():
    return seeds.normals(11, "distribution", STREAM, (STEPS, COUNT), runs=RUNS)


@pytest.fixture(scope="module")
def even():
    grid = np.arange(RUNS)[:, None], np.arange(STEPS)
    return random.uniforms(random.key(12, "distribution"), *grid, STREAM, 2)


def alike(counts, shares, total):
    """Counts of classes that are expected in these shares: neither too far off nor too near."""
    p = stats.chisquare(counts, shares * total).pvalue
    assert 1e-6 < p < 1 - 1e-6


def rare(x, bound):
    """Numbers beyond a bound are as many as they should be."""
    count, share = int(np.sum(np.abs(x) > bound)), 2 * ndtr(-bound)
    assert stats.binomtest(count, x.size, share).pvalue > 1e-6


def test_moments(drawn):
    """Of a normal number: 0, 1, 0, 3, 0, 15; the variance of x^k is m(2k) - m(k)^2."""
    means = [np.mean(drawn**k) for k in range(1, 7)]
    moment = {k: float(stats.norm.moment(k)) for k in range(1, 13)}
    for k, mean in enumerate(means, start=1):
        spread = np.sqrt((moment[2 * k] - moment[k] ** 2) / drawn.size)
        assert abs(mean - moment[k]) < 5 * spread


def test_distribution_and_tails(drawn):
    assert 1e-6 < stats.kstest(drawn.ravel()[::4], "norm").pvalue < 1 - 1e-6
    places = np.minimum((ndtr(drawn.ravel()) * 1024).astype(int), 1023)
    alike(np.bincount(places, minlength=1024), np.full(1024, 1 / 1024), drawn.size)
    for bound in (3.0, 4.0, 5.0):
        rare(drawn, bound)


def test_lanes_steps_components_and_streams_are_uncorrelated(drawn):
    """Neighbours, neighbours over a block of 8, and halves of a pair; squares as well."""
    other = seeds.normals(11, "distribution", Stream.TRUTH, (STEPS, COUNT), runs=RUNS)
    pairs = [(drawn, other), (drawn[..., 0::2], drawn[..., 1::2])]
    pairs += [(drawn[:-n], drawn[n:]) for n in (1, 2, 4, 8)]
    pairs += [(drawn[:, :-n], drawn[:, n:]) for n in (1, 2, 32)]
    pairs += [(drawn[..., :-n], drawn[..., n:]) for n in (1, 2, 4)]
    for a, b in pairs:
        for power, spread in ((1, 1.0), (2, 2.0)):
            product = (a**power - (power == 2)) * (b**power - (power == 2))
            assert abs(np.mean(product)) < 5 * spread / np.sqrt(product.size)


def test_runs_and_steps_have_means_of_their_own(drawn):
    """Means of runs, of steps and of components are normal too: nothing drifts."""
    for axes in ((1, 2), (0, 2), (0, 1)):
        means = drawn.mean(axis=axes)
        total = float(np.sum(means**2)) * drawn.size / len(means)
        assert 1e-6 < stats.chi2.sf(total, len(means)) < 1 - 1e-6


def test_uniform_numbers_are_even_in_every_bit(even):
    bits = (even * 2.0**53).astype(np.uint64)
    for place in range(1, 53):
        share = np.mean((bits >> np.uint64(place)) & np.uint64(1))
        assert abs(share - 0.5) < 5 * 0.5 / np.sqrt(bits.size)
    assert np.all(bits % 2 == 1)  # the middle of its part
    assert np.all((even > 0) & (even < 1))


def test_uniform_pairs_fill_the_square(even):
    cells = (even[0] * 32).astype(int) * 32 + (even[1] * 32).astype(int)
    alike(np.bincount(cells.ravel(), minlength=1024), np.full(1024, 1 / 1024), cells.size)


def test_normal_pairs_have_no_direction(drawn):
    """Angle and radius of a pair are independent: 64 directions of 8 radii."""
    x, y = drawn[..., 0::2].ravel(), drawn[..., 1::2].ravel()
    direction = ((np.arctan2(y, x) / (2 * np.pi) + 0.5) * 64).astype(int) % 64
    radius = np.minimum((np.exp(-0.5 * (x * x + y * y)) * 8).astype(int), 7)
    alike(np.bincount(direction * 8 + radius, minlength=512), np.full(512, 1 / 512), x.size)


@pytest.mark.slow
def test_a_hundred_million_numbers():
    """4,096 classes, moments, and tails to 6 standard deviations (0.2 numbers expected there)."""
    runs, chunks = 16_384, 96
    classes, total = np.zeros(4096), 0
    sums, beyond = np.zeros(4), {4.0: 0, 5.0: 0, 6.0: 0}
    for chunk in range(chunks):
        x = seeds.normals(13, "many", STREAM, (8, 8), runs=runs, first=chunk * runs).ravel()
        places = np.minimum((ndtr(x) * 4096).astype(int), 4095)
        classes += np.bincount(places, minlength=4096)
        sums += [np.sum(x**k) for k in (1, 2, 3, 4)]
        beyond = {bound: n + int(np.sum(np.abs(x) > bound)) for bound, n in beyond.items()}
        total += x.size
    assert total > 1e8
    alike(classes, np.full(4096, 1 / 4096), total)
    z = (sums / total - [0, 1, 0, 3]) / np.sqrt(np.array([1, 2, 15, 96]) / total)
    assert np.max(np.abs(z)) < 5
    for bound, count in beyond.items():
        assert stats.binomtest(count, total, 2 * ndtr(-bound)).pvalue > 1e-6

"""A robust mean of rounded angles, and its interval by target."""

import numpy as np
import pytest

from boresight.calibration.pooled import pool

STEP = 0.2  # degrees


def drawn(rng, sizes, own, mean=0.0):
    """Angles (rad) of targets with an error of their own (degrees), their sd, and their targets."""
    target = np.repeat(np.arange(len(sizes)), sizes)
    sd = rng.uniform(0.02, 0.1, len(target))
    angle = mean + rng.normal(0, own, len(sizes))[target] + sd * rng.normal(size=len(target))
    return np.radians(np.round(angle / STEP) * STEP), np.radians(sd), target


@pytest.mark.parametrize("mean", [180.0, -179.95, 90.0])
def test_an_angle_may_lie_anywhere_on_the_circle(mean):
    angle, sd, target = drawn(np.random.default_rng(0), [4] * 30, 0.1, mean)
    found = pool(np.angle(np.exp(1j * angle)), sd, target, STEP)
    assert -180.0 < found.value <= 180.0
    off = (found.value - mean + 180.0) % 360.0 - 180.0
    assert abs(off) < 4.0 * found.sd < 0.2
    assert np.abs(found.left).max() < 1.0


def test_angles_on_both_sides_of_half_a_turn_have_their_mean_there():
    angle = np.radians(np.tile([179.8, -179.8], 20))
    found = pool(angle, np.full(40, 1e-3), np.arange(40), STEP)
    assert abs(found.value) == pytest.approx(180.0, abs=1e-6)
    assert np.abs(found.left) == pytest.approx(np.full(40, 0.2))


def test_a_mean_is_counted_on_from_where_it_began():
    found = pool(*drawn(np.random.default_rng(0), [4] * 30, 0.1, 2.0), STEP)
    on = found.beyond(179.0)
    assert on.value == pytest.approx(found.value - 181.0)
    assert (on.sd, on.half) == (found.sd, found.half)
    assert on.term().ci95 == pytest.approx((on.value - on.half, on.value + on.half))


def test_an_angle_is_as_uncertain_as_its_rounding_at_least():
    """A number that is rounded to steps errs by up to half of one, all errors alike."""
    rng = np.random.default_rng(6)
    exact = rng.uniform(-20.0, 20.0, 100_000)
    scatter = np.std(np.round(exact / STEP) * STEP - exact)  # good to 0.2 %
    few = np.radians(np.round(rng.normal(0.0, 0.1, 200) / STEP) * STEP)
    found = pool(few, np.full(200, 1e-9), np.arange(200), STEP)
    assert found.spread == pytest.approx(scatter, rel=0.01)


def test_wild_angles_count_for_little():
    angle, sd, target = drawn(np.random.default_rng(1), [4] * 30, 0.1)
    wild = angle.copy()
    wild[::12] += 1.0  # ten of 120, all to one side, by a radian
    before, after = (pool(each, sd, target, STEP) for each in (angle, wild))
    assert abs(after.value - before.value) < 3.0 * before.sd
    assert np.degrees(1.0) / 12 > 50.0 * before.sd  # what a plain mean would have moved by


def test_precise_angles_count_for_more():
    rng = np.random.default_rng(2)
    sd = np.radians(np.where(np.arange(200) < 100, 0.01, 1.0))
    found = pool(sd * rng.normal(size=200), sd, np.arange(200), 0.01)
    assert found.sd < np.degrees(0.002 / 180 * np.pi)  # 0.01 / sqrt(100), and a half more
    assert found.weight[:100].sum() > 0.99
    assert found.weight.sum() == pytest.approx(1.0)


def test_stated_deviations_are_widened_until_they_explain_the_scatter():
    rng = np.random.default_rng(3)
    sd = np.radians(rng.uniform(0.1, 0.3, 2_000))
    found = pool(3.0 * sd * rng.normal(size=2_000), sd, np.arange(2_000), 1e-6)
    # The median of a chi-square of 2,000 is good to 4 % (sd), so its root to 2 %: four of these.
    assert found.wander == pytest.approx(3.0, rel=0.08)


@pytest.mark.parametrize("sizes", [[3] * 12, [1, 1, 2, 2, 3, 3, 20, 40], [10] * 40])
def test_the_interval_covers_as_often_as_it_says(sizes):
    rng, hits, draws = np.random.default_rng(4), 0, 400
    for _ in range(draws):
        found = pool(*drawn(rng, sizes, 0.3), STEP)
        hits += abs(found.value) < found.half
    # 380 of 400 are expected, sd 4.4; an interval that is right is refused once in 5,000.
    assert hits >= 364


def test_without_clusters_the_interval_would_be_too_narrow():
    found = pool(*drawn(np.random.default_rng(5), [20] * 20, 0.3), STEP)
    assert found.sd > 2.0 * found.independent_sd

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
    found = pool(*drawn(np.random.default_rng(0), [4] * 30, 0.1, mean), STEP)
    assert -180.0 < found.value <= 180.0
    off = (found.value - mean + 180.0) % 360.0 - 180.0
    assert abs(off) < 4.0 * found.sd < 0.2
    assert np.abs(found.left).max() < 1.0


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

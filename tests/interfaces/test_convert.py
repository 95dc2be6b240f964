"""The verb `convert`: arrays of any shape, frames, and what it says of a wrong call."""

import numpy as np
import pytest

import boresight as bs
from boresight.models.conversions import CONVERSIONS, convert

SIGMA = np.array([30.0, 0.05, 0.04])


def turned(angle, tilt):
    c, s, ct, st = np.cos(angle), np.sin(angle), np.cos(tilt), np.sin(tilt)
    return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ np.array(
        [[1, 0, 0], [0, ct, st], [0, -st, ct]]
    )


def plots(shape, d, seed=0):
    rng = np.random.default_rng(seed)
    z = rng.uniform([1e3, -3, -1], [5e4, 3, 1], (*shape, 3))[..., :d]
    mean = rng.normal(size=(*shape, 2 * d)) * 1e4
    A = rng.normal(size=(*shape, 2 * d, 2 * d)) * 100
    return z, bs.Gaussian(mean, A @ A.mT)


@pytest.mark.parametrize("name", CONVERSIONS)
@pytest.mark.parametrize("d", [2, 3])
def test_leading_axes_are_plots(name, d):
    z, prior = plots((4, 5), d)
    found = bs.convert(name, z, SIGMA[:d], prediction=prior)
    assert found.mean.shape == (4, 5, d)
    assert found.cov.shape == (4, 5, d, d)
    one = bs.convert(
        name, z[2, 3], SIGMA[:d], prediction=bs.Gaussian(prior.mean[2, 3], prior.cov[2, 3])
    )
    assert np.allclose(found.mean[2, 3], one.mean, rtol=1e-13)
    assert np.allclose(found.cov[2, 3], one.cov, rtol=1e-12)


def test_one_prediction_serves_all_plots_and_one_plot_all_predictions():
    z, prior = plots((6,), 2)
    single = bs.Gaussian(prior.mean[0, :2], prior.cov[0, :2, :2])
    assert bs.convert("ducm", z, SIGMA[:2], prediction=single).cov.shape == (6, 2, 2)
    many = bs.convert("ducm", z[0], np.tile(SIGMA[:2], (6, 1)), prediction=prior)
    assert np.all(many.mean == many.mean[0])
    assert len(np.unique(many.cov[:, 0, 0])) == 6


@pytest.mark.parametrize("name", CONVERSIONS)
@pytest.mark.parametrize("d", [2, 3])
def test_a_turned_and_moved_sensor_sees_the_same(name, d):
    """Erratum B10: in the sensor's frame, and back."""
    z, prior = plots((7,), d)
    pose = bs.Pose(
        position_m=np.array([4e3, -7e3, 300.0]), rotation=turned(0.4, 0.0 if d == 2 else 0.2)
    )
    T, offset = pose.rotation[:d, :d].T, pose.position_m[:d]
    own = bs.Gaussian(prior.mean[:, :d], prior.cov[:, :d, :d])
    outside = bs.Gaussian(own.mean @ T.T + offset, T @ own.cov @ T.T)
    here = bs.convert(name, z, SIGMA[:d], prediction=own)
    there = bs.convert(name, z, SIGMA[:d], prediction=outside, pose=pose)
    assert np.allclose(there.mean, here.mean @ T.T + offset, rtol=1e-12, atol=1e-8)
    scale = np.abs(here.cov).max((-2, -1), keepdims=True)
    assert np.all(np.abs(there.cov - T @ here.cov @ T.T) <= 1e-11 * scale)


def test_the_previous_plot_may_stand_for_a_prediction():
    z = np.array([1e4, 0.3])
    found = bs.convert("ducm", z, SIGMA[:2], prediction=bs.Given(z + 0.01, SIGMA[:2] ** 2))
    exact = convert("ducm", z, SIGMA[:2], bs.Given(z + 0.01, SIGMA[:2] ** 2))
    assert np.array_equal(found.cov, exact.cov)


@pytest.mark.parametrize("name", CONVERSIONS)
def test_a_plot_that_is_not_complete_is_not_converted(name):
    z, prior = plots((3,), 2)
    whole = bs.convert(name, z, SIGMA[:2], prediction=prior)
    z[1, 1], z[2, 0] = np.nan, np.inf
    found = bs.convert(name, z, SIGMA[:2], prediction=prior)
    assert np.array_equal(found.mean[0], whole.mean[0])
    assert np.array_equal(found.cov[0], whole.cov[0])
    assert np.all(np.isnan(found.mean[1:]))
    assert np.all(np.isnan(found.cov[1:]))


def test_inputs_stay_as_they_were():
    z, prior = plots((3,), 3)
    z[0, 0] = np.inf
    before = z.copy(), prior.mean.copy(), prior.cov.copy()
    bs.convert("ducm", z, SIGMA, prediction=prior)
    for now, then in zip((z, *prior), before, strict=True):
        assert np.array_equal(now, then)


_GOOD = bs.Gaussian(np.ones(2), np.eye(2))


@pytest.mark.parametrize(
    ("name", "z", "sigma", "prediction", "told"),
    [
        ("ducn", [1, 0], [1, 1], None, "did you mean 'ducm'"),
        ("ducm", [1, 0, 0, 0], [1, 1, 1, 1], None, "are not plots"),
        ("ducm", 1.0, 1.0, None, "are not plots"),
        ("ducm", [1, 0], [1, 1, 1], None, "are not plots"),
        ("ducm", [1, 0], [1, -1], None, "not negative"),
        ("ducm", [1, 0], [1, np.nan], None, "finite"),
        ("cmkf-d-t", [1, 0], [1, 1], None, "needs to be given the truth"),
        ("ducm", [1, 0, 0], [1, 1, 1], _GOOD, "no position in 3 dimensions"),
        ("ducm", [1, 0], [1, 1], bs.Gaussian(np.ones(2), np.eye(3)), "no position"),
        ("ducm", [1, 0], [1, 1], bs.Given(np.ones(3), np.ones(3)), "not 2 means"),
        ("ducm", np.ones((4, 2)), np.ones((5, 2)), None, "leading axes"),
        ("ducm", np.ones((4, 2)), [1, 1], bs.Gaussian(np.ones((5, 2)), np.eye(2)), "leading axes"),
    ],
)
def test_wrong_calls_are_told_in_one_sentence(name, z, sigma, prediction, told):
    with pytest.raises(bs.UsageError, match=told):
        bs.convert(name, z, sigma, prediction=prediction)

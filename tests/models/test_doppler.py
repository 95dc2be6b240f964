"""Own Doppler taken out, against quadrature; frequencies; signs."""

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.models.doppler import closing_speed, nullify, received_frequency
from boresight.models.motion import ConstantVelocity
from boresight.models.polar import Given
from boresight.models.sensors import Pose, Radar
from oracles import quadrature

SPEED, NOISE = 45.0, 0.2  # m/s
BEARINGS = np.radians([0.0, 15.0, 60.0, -120.0])
SIGMAS = np.radians([0.01, 1.0, 10.0, 60.0])
SOUND, SENT = 1500.0, 50e3


def own(bearings):
    return SPEED * np.cos(bearings)


@pytest.mark.parametrize("bearing", BEARINGS)
@pytest.mark.parametrize("sigma", SIGMAS)
def test_ducm_is_unbiased_and_its_variance_is_that_over_the_prediction(bearing, sigma):
    spread = min(2 * sigma, np.pi / 3)
    truths, outer = quadrature.normal([0, bearing], [0, spread])
    noise, inner = quadrature.normal([0, 0], [0, sigma])
    measured = truths[1][:, None] + noise[1]
    kept = inner @ np.cos(noise[1])
    errors = own(measured) / kept - own(truths[1])[:, None]
    assert np.max(np.abs(errors @ inner)) < 1e-13 * SPEED
    exact = outer @ (errors**2 @ inner) + NOISE**2
    given = Given([1e4, bearing], [100.0, spread**2])
    found = nullify("ducm", 20.0, [bearing], SPEED, [NOISE, sigma], given)
    assert found.mean == pytest.approx(float(20.0 - own(bearing) / kept), rel=1e-13)
    assert found.cov == pytest.approx(float(exact), rel=1e-12)


@pytest.mark.parametrize("bearing", BEARINGS)
@pytest.mark.parametrize("sigma", SIGMAS)
def test_mucm_is_what_the_plot_leaves_possible(bearing, sigma):
    noise, weights = quadrature.normal([0, 0], [0, sigma])
    possible = 20.0 - own(bearing - noise[1])
    mean = possible @ weights
    found = nullify("mucm", 20.0, [bearing], SPEED, [NOISE, sigma])
    assert found.mean == pytest.approx(float(mean), rel=1e-13)
    exact = (possible - mean) ** 2 @ weights + NOISE**2
    assert found.cov == pytest.approx(float(exact), rel=1e-12)
    first = nullify("ducm", 20.0, [bearing], SPEED, [NOISE, sigma])
    exact = (first.mean - possible) ** 2 @ weights + NOISE**2
    assert first.cov == pytest.approx(float(exact), rel=1e-12)


def test_the_standard_form_is_linear_in_the_noise():
    found = nullify("standard", 20.0, [0.5], SPEED, [NOISE, 0.01])
    assert found.mean == pytest.approx(20.0 - SPEED * np.cos(0.5))
    assert found.cov == pytest.approx(NOISE**2 + (SPEED * 0.01 * np.sin(0.5)) ** 2)


def test_in_space_the_share_is_that_of_the_angle_between_heading_and_target():
    noise, weights = quadrature.normal([0, 0.5, -0.7], [0, 0.1, 0.2])
    kept = [weights @ np.cos(noise[1] - 0.5), weights @ np.cos(noise[2] + 0.7)]
    ahead = SPEED * np.cos(noise[1]) * np.cos(noise[2]) / (kept[0] * kept[1])
    share = SPEED * np.cos(0.5) * np.cos(0.7)
    given = Given([1.0, 0.5, -0.7], [0.0, 0.0, 0.0])
    found = nullify("ducm", 20.0, [0.5, -0.7], SPEED, [NOISE, 0.1, 0.2], given)
    exact = (ahead - share) ** 2 @ weights + NOISE**2
    assert found.cov == pytest.approx(float(exact), rel=1e-12)
    assert found.mean == pytest.approx(float(20.0 - share / (kept[0] * kept[1])), rel=1e-13)


def test_a_closing_speed_and_a_frequency_tell_the_same():
    echo = received_frequency(12.5, SENT, SOUND)
    assert echo > SENT  # what closes is heard higher
    assert closing_speed(echo, SENT, SOUND) == pytest.approx(12.5, rel=1e-11)
    # Two-way: to first order the echo is shifted by twice the speed over the speed of sound.
    assert (echo - SENT) / SENT == pytest.approx(2 * 12.5 / SOUND)


def test_what_is_left_is_minus_the_range_rate_of_the_target_alone():
    """Erratum B12: a moving radar's range rate plus its own share is the target's."""
    p, v = np.array([3e3, 4e3]), np.array([-10.0, 6.0])
    pose = Pose(velocity_mps=np.array([SPEED, 0.0, 0.0]))
    radar = Radar(range_rate_mps=1.0, pose=pose)
    (component,) = radar.components(ConstantVelocity(accel_mps2=1.0, dims=2))
    closing = -component.value(np.concatenate([p, v]))
    found = nullify("standard", closing, [np.arctan2(4, 3)], SPEED, [1.0, 1e-9])
    assert found.mean == pytest.approx(-(p @ v) / 5e3, rel=1e-12)


def test_an_unknown_form_is_told():
    with pytest.raises(UsageError, match="did you mean 'ducm'"):
        nullify("ducn", 20.0, [0.0], SPEED, [NOISE, 0.1])

"""A motion and a radar that carry the radar's systematic errors as states."""

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.maths import gradient
from boresight.maths.frames import Site
from boresight.models.considered import Considered, ConsideredRadar, own_states
from boresight.models.motion import ConstantVelocity, WithHeightOffset
from boresight.models.sensors import Pose, Radar

SITE = Site(latitude_deg=47.0, longitude_deg=8.0, height_m=500.0)
INNER = WithHeightOffset(
    inner=ConstantVelocity(accel_mps2=1.0, discretisation="continuous"), drift_m_per_sqrt_s=0.5
)
RADAR = Radar(range_m=30.0, azimuth_deg=0.1, pressure_altitude_m=8.0, site=SITE)
TERMS = ("range_bias_m", "range_gain_m_per_km", "azimuth_bias_deg", "azimuth_cos_deg")
MOTION = Considered(inner=INNER, terms=TERMS)
TARGET = np.array([30e3, -40e3, 9e3, 150.0, 120.0, -5.0, 80.0])


def sensor(terms=TERMS):
    return ConsideredRadar(radar=RADAR, cov=np.eye(len(terms)))


def test_errors_come_last_stay_and_have_no_noise():
    assert MOTION.names == (*INNER.names, *TERMS)
    assert own_states(MOTION) == own_states(INNER) == 7
    state = np.append(TARGET, [10.0, 0.2, -0.1, 0.05])
    np.testing.assert_array_equal(MOTION.move(state, 4.0)[:7], INNER.move(TARGET, 4.0))
    np.testing.assert_array_equal(MOTION.move(state, 4.0)[7:], state[7:])
    np.testing.assert_array_equal(MOTION.noise(4.0)[:7, :7], INNER.noise(4.0))
    assert not MOTION.noise(4.0)[7:].any()


def test_plots_err_by_what_the_errors_are():
    # At 50 km on the ground and 9 km up; 30/50 is the cosine of the azimuth.
    errors = np.array([10.0, 0.2, -0.1, 0.05])
    clean, dirty = RADAR.components(INNER), sensor().components(MOTION)
    state = np.append(TARGET, errors)
    added = [d.value(state) - c.value(TARGET) for c, d in zip(clean, dirty, strict=True)]
    slant = np.sqrt(50e3**2 + 9e3**2)
    expected = [10.0 + 0.2 * slant / 1e3, np.radians(-0.1 + 0.05 * 0.6), 0.0]
    np.testing.assert_allclose(added, expected, rtol=1e-9, atol=1e-9)


def test_gradients_by_an_error_are_its_effect_and_by_the_target_those_of_the_clean_radar():
    state = np.append(TARGET, np.zeros(4))
    E = sensor().design(TARGET, MOTION, sensor().touched(TERMS))
    clean_parts, dirty_parts = RADAR.components(INNER), sensor().components(MOTION)
    for clean, dirty, effect in zip(clean_parts, dirty_parts, [*E, np.zeros(4)], strict=True):
        _, h = gradient(dirty.value, state)
        np.testing.assert_allclose(h[:7], gradient(clean.value, TARGET)[1], rtol=1e-12)
        np.testing.assert_allclose(h[7:], effect, rtol=1e-12)


def test_only_what_terms_can_change_is_touched():
    assert sensor().touched(("azimuth_bias_deg",)) == (1,)
    assert sensor().touched(("time_bias_s",)) == (0, 1)
    assert sensor().touched(()) == ()


@pytest.mark.parametrize(
    "radar",
    [
        Radar(range_m=1.0, azimuth_deg=1.0, pose=Pose(position_m=np.array([1e3, 0.0, 0.0]))),
        Radar(range_m=1.0, azimuth_deg=1.0, range_rate_mps=1.0, range_rate_correlation=0.5),
    ],
    ids=["moved", "correlated"],
)
def test_other_radars_are_refused(radar):
    with pytest.raises(UsageError, match="fixed radar"):
        ConsideredRadar(radar=radar, cov=np.eye(1))


def test_an_unknown_term_is_refused_with_the_nearest_one():
    with pytest.raises(UsageError, match="azimuth_bias_deg"):
        Considered(inner=INNER, terms=("azimut_bias_deg",))


def test_a_motion_without_errors_is_refused():
    with pytest.raises(UsageError, match="motion"):
        sensor().components(INNER)

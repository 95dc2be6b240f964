"""A motion and a radar that carry the radar's systematic errors as states."""

import numpy as np
import pytest

from boresight.errors import UsageError
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


ALL = (*TERMS, "azimuth_sin_deg", "site_east_m", "site_north_m", "time_bias_s")
RAISED = Radar(range_m=30.0, azimuth_deg=0.1, elevation_deg=0.1)


@pytest.mark.parametrize("radar", [RADAR, RAISED], ids=["height", "elevation"])
def test_an_erring_radar_sees_the_target_where_it_is_displaced_to(radar):
    terms = (*ALL, "elevation_bias_deg") if radar is RAISED else ALL
    motion = Considered(inner=INNER, terms=terms)
    seen = ConsideredRadar(radar=radar, cov=np.eye(len(terms)))
    M = seen.displaced(TARGET, motion)
    clean, dirty = radar.components(INNER), seen.components(motion)
    for j in range(len(terms)):
        b = 1e-3 * np.eye(len(terms))[j]
        for here, there in zip(clean, dirty, strict=True):
            moved = here.value(TARGET + M @ b) - here.value(TARGET)
            if here.name == "pressure_altitude_m":  # heights are taken as they are
                assert abs(moved) <= 0.01 * np.linalg.norm(M[:2] @ b) + abs(M[2] @ b)
                continue
            added = there.value(np.append(TARGET, b)) - here.value(TARGET)
            assert moved == pytest.approx(added, rel=1e-3, abs=2e-5), (terms[j], here.name)


def test_the_displacement_of_a_velocity_is_the_rate_of_that_of_the_place():
    motion = Considered(inner=INNER, terms=ALL)
    seen = ConsideredRadar(radar=RADAR, cov=np.eye(len(ALL)))
    ahead, behind = (seen.displaced(INNER.move(TARGET, dt), motion)[:3] for dt in (0.1, -0.1))
    found = seen.displaced(TARGET, motion)
    np.testing.assert_allclose(found[3:6], (ahead - behind) / 0.2, rtol=1e-6, atol=1e-9)
    assert not found[6].any()


def test_overhead_a_displacement_is_finite():
    motion = Considered(inner=INNER, terms=ALL)
    seen = ConsideredRadar(radar=RADAR, cov=np.eye(len(ALL)))
    above = np.array([0.0, 0.0, 9e3, 150.0, 0.0, 0.0, 0.0])
    assert np.isfinite(seen.displaced(above, motion)).all()


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

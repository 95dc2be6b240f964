"""What a component says, and its gradient, against definitions and numeric derivatives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.maths import gradient, jacobian
from boresight.maths.angles import wrap
from boresight.maths.frames import ecef_from_enu, geodetic_from_ecef
from boresight.models.components import FORMULAS, Component
from boresight.models.sensors import Radar
from laws.enrolled import BEARING_WORLDS, LINEAR_WORLDS, POLAR_WORLDS, SITE, SPACE, World
from oracles import filters as textbook

seeds = st.integers(0, 2**32)
WORLDS = (*POLAR_WORLDS, *LINEAR_WORLDS, *BEARING_WORLDS)
km, mm = 1e3, 1e-3
each = pytest.mark.parametrize(
    ("world", "index"),
    [(w, i) for w in WORLDS for i in range(len(w.sensor.names))],
    ids=lambda v: str(v) if isinstance(v, World) else None,
)


def derivative(h, x, i, step, *, angle=False):
    """Slope of h along x[i], sixth order central differences in extended precision."""
    x, total = np.asarray(x, dtype=np.longdouble), np.longdouble(0)
    for k, weight in ((1, 45), (2, -9), (3, 1)):
        ahead, behind = x.copy(), x.copy()
        ahead[i] += k * np.longdouble(step)
        behind[i] -= k * np.longdouble(step)
        difference = np.asarray(h(ahead)) - h(behind)
        total = total + weight * (wrap(difference) if angle else difference)
    return np.asarray(total / (60 * np.longdouble(step)), dtype=float)


def check_gradient(h, x, steps, *, angle):
    value, slope = gradient(h, x)
    assert np.isfinite(value)
    numeric = [derivative(h, x, i, step, angle=angle) for i, step in enumerate(steps)]
    scale = np.max(np.abs(slope)) or 1.0
    np.testing.assert_allclose(slope, numeric, rtol=1e-9, atol=1e-10 * scale)


@each
@given(seed=seeds)
def test_gradients_are_derivatives(world, index, seed):
    mean, _ = world.prior(seed)
    component = world.sensor.components(world.motion)[index]
    check_gradient(component.value, mean, [1.0] * len(mean), angle=component.is_angle)


@given(st.lists(st.floats(-9e4, 9e4), min_size=3, max_size=3), st.sampled_from([2, 3]))
def test_a_cone_is_the_angle_off_the_axis(p, dims):
    p = np.array(p[:dims]) + [0.0, 1.0, 0.0][:dims]
    cosine = p[0] / np.linalg.norm(p)
    assert np.cos(FORMULAS["cone_rad"](p, p)) == pytest.approx(cosine, abs=1e-12)
    assert 0.0 <= FORMULAS["cone_rad"](p, p) <= np.pi


@pytest.mark.parametrize("world", BEARING_WORLDS, ids=str)
@given(seed=seeds)
def test_an_angle_in_the_plane_is_that_of_its_legs(world, seed):
    """Which are linear in the state, on either side of a cone's axis."""
    mean, _ = world.prior(seed)
    found = [c for c in world.sensor.components(world.motion) if c.legs is not None]
    assert [c.name for c in found] == [n for n in world.sensor.names if n.endswith("_rad")]
    for component in found:
        x, y = component.legs(mean)
        assert np.arctan2(y, x) == pytest.approx(component.value(mean), abs=1e-12)
        _, slopes = jacobian(lambda state, c=component: np.array(c.legs(state)), mean)
        length = np.hypot(*np.array(slopes)[:, : world.motion.dims])
        np.testing.assert_allclose(length, 1.0, rtol=1e-12)


def test_angles_in_space_have_no_legs_but_the_azimuth():
    everything = Radar(range_m=1.0, azimuth_deg=1.0, elevation_deg=1.0, cone_deg=1.0)
    parts = everything.components(SPACE)
    assert [c.name for c in parts if c.legs is not None] == ["azimuth_rad"]


@pytest.mark.parametrize("name", FORMULAS)
@pytest.mark.parametrize(
    "p",
    [
        (0.0, 0.0, 8 * km),  # overhead
        (0.0, 0.0, 0.0),  # at the sensor
        (3 * mm, -2 * mm, 8 * km),  # a hair off the axis, outside the floor
        (0.4 * mm, 0.2 * mm, 8 * km),  # inside it
        (-20 * km, 0.0, 1 * km),  # on the seam of the azimuth
        (-20 * km, -1e-9, 1 * km),  # under it
        (20 * km, 3 * km, 0.0),  # on the horizon
        (1e-200, 0.0, 5 * km),  # where squares underflow
    ],
    ids=str,
)
def test_gradients_are_derivatives_where_it_is_singular(name, p):
    velocity = np.array([30.0, -10.0, 5.0])

    def h(x):
        return FORMULAS[name](x, velocity)

    angle = name.endswith("_rad")
    near_axis, near_sensor = np.hypot(p[0], p[1]) < 1, np.linalg.norm(p) < 1
    across = 0.01 * mm if near_sensor or (near_axis and angle) else 1.0
    steps = [across, across, 0.01 * mm if near_sensor else 30.0]
    check_gradient(h, np.array(p), steps, angle=angle)


@given(seed=seeds)
def test_polar_components_are_the_polar_coordinates(seed):
    for world in POLAR_WORLDS[:2]:
        mean, _ = world.prior(seed)
        values = [c.value(mean) for c in world.sensor.components(world.motion)]
        np.testing.assert_allclose(values, textbook.polar(mean[: world.motion.dims]), rtol=1e-14)


@given(seed=seeds)
def test_range_rate_is_the_rate_of_range_as_the_sensor_moves(seed):
    world = POLAR_WORLDS[2]
    mean, _ = world.prior(seed)
    pose, by_name = world.sensor.pose, dict(zip(world.sensor.names, range(9), strict=False))
    rate = world.sensor.components(world.motion)[by_name["range_rate_mps"]].value(mean)

    def distance(t):
        gap = mean[:3] + mean[3:] * t[0] - pose.position_m - pose.velocity_mps * t[0]
        return np.sqrt(np.sum(np.square(gap)))

    assert rate == pytest.approx(derivative(distance, [0.0], 0, 0.01), rel=1e-11, abs=1e-9)


@given(seed=seeds)
def test_a_pose_is_a_change_of_axes(seed):
    world = POLAR_WORLDS[2]
    mean, _ = world.prior(seed)
    pose = world.sensor.pose
    seen = [c.value(mean) for c in world.sensor.components(world.motion)][:3]
    np.testing.assert_allclose(
        seen, textbook.polar(pose.rotation @ (mean[:3] - pose.position_m)), rtol=1e-12
    )


@given(seed=seeds)
def test_heights_are_above_the_ellipsoid_and_carry_their_offset(seed):
    world = POLAR_WORLDS[4]
    mean, _ = world.prior(seed)
    north, east, up = mean[:3]
    height = geodetic_from_ecef(ecef_from_enu(np.array([east, north, up]), SITE)).height_m
    values = dict(
        zip(
            world.sensor.names,
            (c.value(mean) for c in world.sensor.components(world.motion)),
            strict=True,
        )
    )
    assert values["height_m"] == pytest.approx(height, abs=1e-5)
    assert values["pressure_altitude_m"] == pytest.approx(height + mean[-1], abs=1e-5)


def test_standard_deviations_arrive_in_the_unit_of_the_plot():
    world = POLAR_WORLDS[4]
    sigmas = {c.name: c.sigma for c in world.sensor.components(world.motion)}
    assert sigmas == pytest.approx(
        {
            "range_m": 30.0,
            "azimuth_rad": 0.013962634015954637,  # 0.8 degrees
            "elevation_rad": 0.010471975511965978,  # 0.6 degrees
            "height_m": 60.0,
            "pressure_altitude_m": 40.0,
            "range_rate_mps": 2.0,
        }
    )


@pytest.mark.parametrize("name", [*FORMULAS, "height_m", "x_m"])
def test_angles_wrap_and_nothing_else_does(name):
    component = Component(name, None, 1.0)
    expected = -0.2 if name in ("azimuth_rad", "elevation_rad", "cone_rad") else 2 * np.pi - 0.2
    assert component.residual(2 * np.pi + 0.1, 0.3) == pytest.approx(expected)
    assert component.residual(2.0, -0.9) == pytest.approx(2.9)  # nearly half a turn is no turn

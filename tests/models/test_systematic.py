"""Systematic errors against a radar that makes them: no formula here is the package's own."""

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.maths import gradient
from boresight.maths.frames import Site, enu_from_geodetic, geodetic_from_enu
from boresight.models.systematic import CHANNELS, TERMS, SystematicErrors, design, effects

DEGREE = np.pi / 180.0
# North, east, up: everywhere around, due south (where azimuths wrap), low, high, almost overhead.
PLACES = {
    "north-east": [30e3, 40e3, 9e3],
    "south-west": [-80e3, -25e3, 6e3],
    "south": [-50e3, 0.0, 8e3],
    "just west of south": [-50e3, -1e-3, 8e3],
    "north": [60e3, 0.0, 3e3],
    "below": [20e3, -10e3, -150.0],
    "far": [-250e3, 200e3, 3e3],
    "near": [40.0, -60.0, 10.0],
    "almost overhead": [3.0, 2.0, 5e3],
}
VELOCITY = np.array([130.0, -170.0, 12.0])


def seen(p):
    """Range, azimuth clockwise from North, elevation of a place (north, east, up)."""
    north, east, up = p
    ground = np.hypot(north, east)
    return np.array([np.hypot(ground, up), np.arctan2(east, north), np.arctan2(up, ground)])


def measured(term, amount, p, v):
    """What a radar with this error, and no other, measures of a target that is at p now."""
    moved = {
        "time_bias_s": -amount * v,  # it was measured that long ago
        "site_east_m": np.array([0.0, -amount, 0.0]),
        "site_north_m": np.array([-amount, 0.0, 0.0]),
    }
    r, azimuth, elevation = seen(p + moved.get(term, 0.0))
    added = {
        "range_bias_m": (amount, 0.0, 0.0),
        "range_gain_m_per_km": (amount * r / 1_000.0, 0.0, 0.0),
        "azimuth_bias_deg": (0.0, amount * DEGREE, 0.0),
        "azimuth_cos_deg": (0.0, amount * DEGREE * np.cos(azimuth), 0.0),
        "azimuth_sin_deg": (0.0, amount * DEGREE * np.sin(azimuth), 0.0),
        "elevation_bias_deg": (0.0, 0.0, amount * DEGREE),
    }
    return np.array([r, azimuth, elevation]) + np.array(added.get(term, (0.0, 0.0, 0.0)))


def difference(one, other):
    d = one - other
    d[1] = np.angle(np.exp(1j * d[1]))
    return d


def table(term, p, v):
    """Effects of a term on all channels; a channel that it does not touch is zero."""
    found = effects(term, p, v)
    assert set(found) <= set(CHANNELS)
    return np.array([found.get(channel, 0.0) for channel in CHANNELS])


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("term", TERMS)
def test_an_effect_is_the_slope_of_what_is_measured(term, place):
    p = np.array(PLACES[place])
    # A step that moves the target by a ten-thousandth of its distance from the axis, at most.
    speed = {"time_bias_s": np.linalg.norm(VELOCITY)}.get(term, 1.0)
    h = 1e-4 * min(np.hypot(p[0], p[1]), 1e3) / speed
    slope = difference(measured(term, h, p, VELOCITY), measured(term, -h, p, VELOCITY)) / (2 * h)
    rounding = 1e-15 * np.array([np.linalg.norm(p), np.pi, np.pi]) / h
    off = np.abs(table(term, p, VELOCITY) - slope)
    assert np.all(off <= 1e-6 * np.abs(slope) + rounding)


@pytest.mark.parametrize("term", TERMS)
def test_small_errors_are_first_order_everywhere(term):
    """Halving an error leaves a quarter of what the effect does not explain, or rounding."""
    p = np.array(PLACES["north-east"])

    def unexplained(amount):
        shift = difference(measured(term, amount, p, VELOCITY), seen(p))
        return np.abs(shift - amount * table(term, p, VELOCITY))

    amount = TERMS[term].scale / 10.0
    rounding = 1e-11 * np.array([5e4, 1.0, 1.0])
    assert np.all(unexplained(amount / 2) < 0.26 * unexplained(amount) + rounding)


def test_the_site_is_where_the_antenna_really_is_minus_where_it_is_said_to_be():
    said = Site(latitude_deg=50.0, longitude_deg=8.0, height_m=100.0)
    moved = geodetic_from_enu(np.array([30.0, 80.0, 0.0]), said)  # really 30 m east, 80 m north
    real = Site(
        latitude_deg=float(moved.latitude_deg),
        longitude_deg=float(moved.longitude_deg),
        height_m=float(moved.height_m),
    )
    expected = enu_from_geodetic(50.2, 8.4, 9_000.0, said)[[1, 0, 2]]
    from_there = enu_from_geodetic(50.2, 8.4, 9_000.0, real)[[1, 0, 2]]
    shift = difference(seen(from_there), seen(expected))
    effect = 30.0 * table("site_east_m", expected, VELOCITY)
    effect += 80.0 * table("site_north_m", expected, VELOCITY)
    # Besides, North and up at 85 m off are not quite the same: 1.3e-5 rad, 0.5 m at this range.
    assert shift[0] == pytest.approx(effect[0], abs=0.2)
    assert shift[1:] == pytest.approx(effect[1:], abs=2e-5)
    assert np.abs(effect[1]) > 1e-4


def test_a_time_bias_is_the_stamp_minus_the_time_of_measurement():
    def place(t):
        return np.array(PLACES["north-east"]) + VELOCITY * t

    late = 0.02  # the stamp says 0.02 s more than the clock did
    stamp = 100.0
    residual = difference(seen(place(stamp - late)), seen(place(stamp)))
    effect = late * table("time_bias_s", place(stamp), VELOCITY)
    assert residual == pytest.approx(effect, rel=1e-3, abs=1e-12)
    assert np.abs(residual[0]) > 0.1


@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize("p", [[0.0, 0.0, 5e3], [0.0, 0.0, 0.0], [0.0, 0.0, -80.0]])
def test_right_above_the_radar_effects_and_their_slopes_are_finite(term, p):
    p = np.array(p)
    assert np.isfinite(table(term, p, VELOCITY)).all()
    for channel in effects(term, p, VELOCITY):
        _, slope = gradient(lambda x, channel=channel: effects(term, x, VELOCITY)[channel], p)
        assert np.isfinite(slope).all()


def test_design_has_a_column_for_each_term_in_the_order_asked_for():
    p, v = np.array([*PLACES.values()]), np.outer(np.linspace(0.1, 2.0, len(PLACES)), VELOCITY)
    channels, terms = ("azimuth_rad", "range_m"), tuple(reversed(TERMS))
    found = design(terms, channels, p, v)
    assert found.shape == (len(p), 2, len(terms))
    for i in range(len(p)):
        for j, term in enumerate(terms):
            range_m, azimuth, _ = table(term, p[i], v[i])
            assert found[i, :, j] == pytest.approx([azimuth, range_m], rel=1e-14)


def test_design_foretells_what_all_errors_together_do():
    rng = np.random.default_rng(0)
    p = rng.normal(size=(200, 3)) * [6e4, 6e4, 0.0] + [0.0, 0.0, 8e3]
    v = rng.normal(size=(200, 3)) * [150.0, 150.0, 5.0]
    amounts = {term: 1e-4 * kind.scale * rng.normal() for term, kind in TERMS.items()}
    together = design(tuple(TERMS), CHANNELS, p, v) @ np.array([*amounts.values()])
    apart = [
        sum(difference(measured(t, a, x, u), seen(x)) for t, a in amounts.items())
        for x, u in zip(p, v, strict=True)
    ]
    far = np.hypot(p[:, 0], p[:, 1]) > 5e3
    assert together[far] == pytest.approx(np.array(apart)[far], rel=1e-2, abs=1e-8)


@pytest.mark.parametrize("call", [effects, lambda term, p, v: design([term], CHANNELS, [p], [v])])
def test_an_unknown_term_is_named_with_its_neighbour(call):
    with pytest.raises(UsageError, match="range_bias_m"):
        call("range_bias", np.ones(3), np.ones(3))


def errors(**amounts):
    """Amounts by term, with a covariance that does not matter."""
    n = len(amounts)
    return SystematicErrors(
        terms=tuple(amounts), estimate=np.array([*amounts.values()]), cov=np.eye(n)
    )


PLANTED = {
    "range_bias_m": 120.0,
    "range_gain_m_per_km": -1.5,
    "azimuth_bias_deg": 0.8,
    "azimuth_cos_deg": -0.6,
    "azimuth_sin_deg": 0.4,
    "elevation_bias_deg": -0.3,
    "time_bias_s": 0.4,
}


def planted(true):
    """The same errors as `PLANTED`, made by hand; the gain is of the true range."""
    r, azimuth, elevation = true
    wave = -0.6 * np.cos(azimuth) + 0.4 * np.sin(azimuth)
    return {
        "range_m": 120.0 + r * (1.0 - 1.5e-3),
        "azimuth_rad": (azimuth + (0.8 + wave) * DEGREE) % (2.0 * np.pi),
        "elevation_rad": elevation - 0.3 * DEGREE,
    }


def test_what_is_planted_is_taken_out_again():
    true = np.array(
        [np.linspace(1e3, 4e5, 721), np.linspace(0.0, 2 * np.pi, 721), np.linspace(-0.1, 1.5, 721)]
    )
    clean = errors(**PLANTED).corrected(planted(true))
    assert clean["range_m"] == pytest.approx(true[0], rel=1e-12)
    off = np.angle(np.exp(1j * (clean["azimuth_rad"] - true[1])))
    assert np.abs(off).max() < 5e-6 * DEGREE  # a thousandth of the finest encoder's step
    assert clean["elevation_rad"] == pytest.approx(true[2], abs=1e-12)
    assert (clean["azimuth_rad"] >= 0.0).all()
    assert (clean["azimuth_rad"] < 2.0 * np.pi).all()


@pytest.mark.parametrize("azimuth", [0.0, -1e-17, 2.0 * np.pi, -1e-9, 7.0])
def test_corrected_azimuths_lie_within_one_turn_from_zero(azimuth):
    found = errors(azimuth_bias_deg=0.0).corrected({"azimuth_rad": [azimuth]})["azimuth_rad"]
    assert 0.0 <= found[0] < 2.0 * np.pi
    assert np.exp(1j * found[0]) == pytest.approx(np.exp(1j * azimuth), abs=1e-12)


def test_correction_keeps_what_it_was_given():
    z = {"range_m": np.array([1e4, np.nan]), "azimuth_rad": np.array([0.1, np.nan])}
    before = {name: value.copy() for name, value in z.items()}
    clean = errors(**PLANTED).corrected(z)
    assert set(clean) == set(z)
    assert all(np.array_equal(z[name], before[name], equal_nan=True) for name in z)
    assert np.isnan(clean["range_m"][1])
    assert np.isnan(clean["azimuth_rad"][1])


def test_no_errors_change_no_plot():
    z = {"range_m": np.array([1e4]), "azimuth_rad": np.array([6.2]), "elevation_rad": [0.2]}
    clean = errors().corrected(z)
    assert {name: float(value[0]) for name, value in clean.items()} == {
        "range_m": 1e4,
        "azimuth_rad": 6.2,
        "elevation_rad": 0.2,
    }


def test_time_and_site_are_no_plots_to_correct():
    z = {"range_m": [1e4], "azimuth_rad": [1.0]}
    clean = errors(time_bias_s=2.0, site_east_m=500.0, site_north_m=500.0).corrected(z)
    assert float(clean["range_m"][0]) == 1e4
    assert float(clean["azimuth_rad"][0]) == pytest.approx(1.0, abs=1e-15)


def test_a_value_is_its_terms_estimate_or_zero():
    found = errors(range_bias_m=3.0, time_bias_s=-0.2)
    assert found.value("time_bias_s") == -0.2
    assert found.value("azimuth_bias_deg") == 0.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"terms": ("nonsense",)},
        {"estimate": np.zeros(2)},
        {"estimate": np.array([np.nan])},
        {"cov": np.zeros((1, 2))},
        {"cov": np.array([[np.inf]])},
        {"terms": ("time_bias_s", "time_bias_s"), "estimate": np.zeros(2), "cov": np.eye(2)},
    ],
)
def test_errors_that_make_no_sense_are_refused(wrong):
    right = {"terms": ("time_bias_s",), "estimate": np.zeros(1), "cov": np.eye(1)}
    SystematicErrors(**right)
    with pytest.raises(UsageError):
        SystematicErrors(**(right | wrong))

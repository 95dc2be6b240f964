"""Geometries that cannot tell some errors apart say so, always; rich ones hardly ever do."""

from dataclasses import replace

import numpy as np
import pytest
from radar_worlds import SIX, Noise, flights, world

from boresight.calibration.observability import observability
from boresight.calibration.registration import register

TARGETS = 20
NOISE = Noise(delay_m=10.0)


def parts(rng, pairs):
    """(target, time, height, speed) of pairs of some targets."""
    target = np.sort(rng.integers(0, TARGETS, pairs))
    height, speed = rng.uniform(3e3, 11e3, TARGETS), rng.uniform(120.0, 260.0, TARGETS)
    way = rng.choice([-1.0, 1.0], TARGETS)
    return target, rng.uniform(-300.0, 300.0, pairs), height[target], (way * speed)[target]


def radial(rng, pairs):
    """Everyone on one azimuth, towards the radar or away."""
    target, when, height, speed = parts(rng, pairs)
    azimuth, r = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(90e3, 200e3, TARGETS)[target]
    out = np.array([np.cos(azimuth), np.sin(azimuth)])
    place = np.column_stack([np.outer(r + speed * when, out), height])
    return target, place, np.column_stack([np.outer(speed, out), 0.0 * when])


def circling(rng, pairs, rate, ground, height):
    """Everyone on circles around the radar: (pairs,) angular rates, ground ranges, heights."""
    target, when, _, _ = parts(rng, pairs)
    a = rng.uniform(0.0, 2.0 * np.pi, TARGETS)[target] + rate[target] * when
    place = np.column_stack(
        [ground[target] * np.cos(a), ground[target] * np.sin(a), height[target]]
    )
    speed = ground[target] * rate[target]
    return target, place, np.column_stack([-speed * np.sin(a), speed * np.cos(a), 0.0 * a])


def ring(rng, pairs):
    """One slant range, both ways round."""
    rate = rng.choice([-1.0, 1.0], TARGETS) * rng.uniform(120.0, 260.0, TARGETS) / 80e3
    height = np.full(TARGETS, 8e3)
    return circling(rng, pairs, rate, np.sqrt(80e3**2 - height**2), height)


def whirling(rng, pairs):
    """One angular rate for all: a late clock turns the picture as an azimuth bias does."""
    height = rng.uniform(3e3, 11e3, TARGETS)
    return circling(rng, pairs, np.full(TARGETS, 0.0025), rng.uniform(20e3, 150e3, TARGETS), height)


def hovering(rng, pairs):
    """One target at one place, its reference jittering."""
    azimuth, r = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(20e3, 100e3)
    place = np.array([r * np.cos(azimuth), r * np.sin(azimuth), 500.0])
    jitter = rng.normal(size=(2, pairs, 3))
    return np.zeros(pairs, dtype=int), place + jitter[0], 0.5 * jitter[1]


CASES = {
    radial: {"azimuth_bias_deg", "azimuth_cos_deg", "azimuth_sin_deg"},
    ring: {"range_bias_m", "range_gain_m_per_km"},
    whirling: {"time_bias_s", "azimuth_bias_deg"},
    hovering: {*SIX},
}


def judged(geometry, seed, pairs=1_000):
    made, _ = world(seed, place=geometry(np.random.default_rng(seed), pairs), noise=NOISE)
    return register(made, SIX)


def check(geometry, hidden, seeds):
    """What no plot shows is told so with its direction, and has no small interval."""
    scale = {"range_bias_m": 100.0, "range_gain_m_per_km": 1.0, "time_bias_s": 1.0}
    for seed in seeds:
        found = judged(geometry, seed)
        said = {name for name, term in found.terms.items() if not term.observable}
        named = {name for d in found.directions if not d.observable for name in d.weights}
        wide = [name for name in said if found.terms[name].sd > 0.1 * scale.get(name, 1.0)]
        assert said == hidden, (geometry.__name__, seed)
        assert hidden <= named | said
        assert any(not d.observable and d.words for d in found.directions)
        assert len(wide) >= 2


@pytest.mark.parametrize("geometry", CASES, ids=lambda g: g.__name__)
def test_what_the_geometry_cannot_tell_is_said(geometry):
    check(geometry, CASES[geometry], range(4))


@pytest.mark.slow
@pytest.mark.parametrize("geometry", CASES, ids=lambda g: g.__name__)
def test_what_the_geometry_cannot_tell_is_said_two_hundred_times(geometry):
    check(geometry, CASES[geometry], range(200))


@pytest.mark.parametrize("given", [True, False])
def test_an_elevation_bias_without_elevations_is_not_observable(given):
    pairs, _ = world(3, pairs=1_000, targets=20)
    if given:  # the channel is there, and empty
        z = np.column_stack([pairs.z, np.full(len(pairs), np.nan)])
        pairs = replace(pairs, z=z, channels=(*pairs.channels, "elevation_rad"))
    found = register(pairs, (*SIX, "elevation_bias_deg"))
    said = {name for name, term in found.terms.items() if not term.observable}
    assert said == {"elevation_bias_deg"}
    assert found.terms["elevation_bias_deg"].sd == pytest.approx(5.0, rel=1e-6)
    assert [*found.directions[0].weights] == ["elevation_bias_deg"]
    assert found.noise.elevation_deg is None


@pytest.mark.parametrize(("targets", "told"), [(3, False), (300, True)])
def test_many_plots_of_few_targets_are_worth_few(targets, told):
    """30,000 plots, each a fifth of what is believed: enough alone, but three targets made them."""
    term = ("range_bias_m",)
    each = 30_000 // targets
    one = np.array([[0.2 / 1_000.0**2]])  # of one plot, over the scale of a range bias
    found = observability(
        term, np.array([each * one] * targets), np.full(targets, each), 1.0 * one, np.zeros(1)
    )
    assert found.observable.tolist() == [told]


def alarms(seeds, pairs):
    """How many rich worlds have a term called not observable, or hardly separable."""
    hidden = hard = 0
    for seed in seeds:
        place = flights(np.random.default_rng(seed), pairs, 40)
        found = register(world(seed, place=place, noise=Noise(delay_m=30.0))[0], SIX)
        hidden += not all(term.observable for term in found.terms.values())
        hard += bool(found.directions)
    return hidden, hard


def test_a_rich_geometry_raises_no_alarm():
    assert alarms(range(10), 1_000) == (0, 0)


@pytest.mark.slow
def test_rich_geometries_raise_at_most_one_alarm_in_a_hundred():
    hidden, hard = alarms(range(300), 2_000)
    assert hidden <= 3
    assert hard <= 3


def test_terms_that_are_nearly_one_are_named_together_with_what_is_known():
    """Ranges of 100 to 110 km only: bias and gain are told, but hardly from one another."""
    place = flights(np.random.default_rng(2), 4_000, 40, near_m=130e3, far_m=150e3)
    found = register(world(2, place=place, noise=Noise(range_m=20.0, azimuth_deg=0.02))[0], SIX)
    (direction,) = found.directions  # one for a combination, however many terms it has
    assert found.terms["range_gain_m_per_km"].observable
    assert direction.observable
    assert direction.correlation < -0.95
    assert {*direction.weights} == {"range_bias_m", "range_gain_m_per_km"}
    assert "hardly separable" in direction.words
    assert "range error at" in direction.words
    assert "e+" not in direction.words
    assert " °" not in direction.words

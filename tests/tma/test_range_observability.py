"""Whether bearings tell the range: never without a manoeuvre, and soon after one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.filters.fisher import information_through, polar_bound
from boresight.formats.bearings import read_bearings
from boresight.formats.own_ship import read_own_ship
from boresight.maths import Gaussian
from boresight.mixtures.bank import Bank, run_bank
from boresight.mixtures.range_parameterised import RangeParameterised
from boresight.target_motion import observability
from boresight.target_motion.contact import Contact
from boresight.target_motion.contacts import contacts
from boresight.target_motion.observability import observe
from mixtures import heard
from oracles import pradeep as paper

TOWED = Path(__file__).parents[2] / "../shared/data/towed-array"
OWN = heard.OWN[:, ::-1]  # North, East
STEADY = np.outer(np.arange(801.0), OWN[1] - OWN[0])
TARGET = paper.target(paper.TARGET)[:, ::-1]


def contact_of(own, seed=0, *, steps=801, said=None, cone=False):
    """The paper's target as heard from own (801, 2); `said` is where own ship says it was."""
    noise = paper.SIGMA * np.random.default_rng(seed).standard_normal(801)
    at = TARGET - own
    bearing, way = np.arctan2(at[:, 1], at[:, 0]), np.gradient(own, axis=0)
    axis, nothing = np.arctan2(way[:, 1], way[:, 0]), np.full(801, np.nan)
    angle = np.abs(paper.wrap(bearing - axis)) if cone else bearing
    columns = {
        "time_s": np.arange(801.0),
        "bearing_rad": nothing if cone else angle + noise,
        "cone_rad": angle + noise if cone else nothing,
        "sigma_rad": np.full(801, paper.SIGMA),
        "position_m": own if said is None else said,
        "velocity_mps": way,
        "axis_rad": axis if cone else nothing,
    }
    return Contact(name="one", **{name: column[:steps] for name, column in columns.items()})


def bank_of(contact, method=None):
    """Six cells; the first bearing makes the start."""
    method, z = method or RangeParameterised(), contact.plots.copy()
    start = method.start(z[:, 0], heard.straight(), contact.sensor)
    z[:, 0] = np.nan
    first = Gaussian(start.mean[0], start.cov[0])
    return run_bank(method, heard.straight(), contact.sensor, z, contact.dt, first)


def seen(own, seed=0, **given):
    """The answer for one contact."""
    contact = contact_of(own, seed, **given)
    return observe(contact, bank_of(contact))


def believing(states, weights):
    """A bank that has always held these states (cells, 4), each moved along its straight track."""
    steps, cells = 801, len(states)
    ago = np.arange(steps) - 800.0
    means = np.repeat(np.array(states)[None], steps, axis=0)
    means[..., :2] += ago[:, None, None] * means[..., 2:]
    none = np.zeros((steps, cells))
    return Bank(
        weights=np.tile(weights, (steps, 1)),
        means=means,
        covs=np.tile(np.eye(4), (steps, cells, 1, 1)),
        loglik=none,
        innovation=none[..., None],
        variance=none[..., None],
        side=np.zeros(cells),
    )


def test_nothing_is_told_without_a_manoeuvre():
    for seed in range(5):
        found = seen(STEADY, seed)
        assert not found.observable
        assert found.since_s is None
        assert not found.manoeuvred
        assert np.all(np.isinf(found.by_step))
        assert found.range_sd_m == found.at_best_percent == np.inf


def test_a_manoeuvre_tells_within_half_a_minute():
    for seed in range(5):
        found = seen(OWN, seed)
        assert found.observable
        assert found.manoeuvred
        assert 121.0 < found.since_s < 150.0
        assert not seen(OWN, seed, steps=int(found.since_s)).observable
        assert seen(OWN, seed, steps=int(found.since_s) + 1).observable
        assert np.all(np.isinf(found.by_step[:120]))
        assert 50.0 < found.range_sd_m < 110.0


@pytest.mark.slow
def test_two_hundred_runs_of_each():
    assert not any(seen(STEADY, seed).observable for seed in range(200))
    turned = [seen(OWN, seed, steps=241) for seed in range(200)]
    assert all(found.observable for found in turned)
    since = np.array([found.since_s for found in turned])
    assert np.all((since > 121.0) & (since < 180.0))


def test_the_bound_is_that_of_the_heaviest_cell_s_straight_track():
    contact = contact_of(OWN)
    bank = bank_of(contact)
    found = observe(contact, bank)
    state = bank.means[-1, np.argmax(bank.weights[-1])]
    args = heard.straight(), contact.sensor, contact.dt, np.ones((801, 1))
    information = information_through(state[None], np.array([800]), *args)
    expected = polar_bound(information, state[None], OWN[[800]])[0, 0]
    assert found.range_sd_m == found.by_step[-1] == pytest.approx(expected, rel=1e-9)


def test_nearly_all_of_the_weight_must_agree():
    contact, speed = contact_of(OWN), paper.TARGET * paper.heading(paper.COURSE)[::-1]
    near = np.hstack([TARGET[-1], speed])
    far = np.hstack([OWN[-1] + 500.0 * (TARGET[-1] - OWN[-1]), speed])  # 7,000 km: no turn tells
    sure, unsure = (
        observe(contact, believing([near, far], [share, 1.0 - share])) for share in (0.96, 0.94)
    )
    assert sure.observable
    assert not unsure.observable
    assert unsure.manoeuvred  # own ship did what it could


def test_a_stricter_demand_is_met_later():
    contact = contact_of(OWN)
    bank = bank_of(contact)
    since = [observe(contact, bank, widest_percent=p).since_s for p in (50.0, 10.0, 3.0)]
    assert since[0] < since[1] < since[2]
    assert observe(contact, bank, widest_percent=0.1).since_s is None
    doubtful = observe(contact, bank, position_sd_m=1_000.0)
    assert not doubtful.observable


def test_a_receiver_that_shakes_has_not_manoeuvred():
    shaken = 3.0 * np.random.default_rng(9).standard_normal(STEADY.shape)
    steady = seen(STEADY, said=STEADY + shaken)
    assert np.isfinite(steady.range_sd_m)  # taken at its word, own ship's path tells a little
    assert not steady.observable
    assert not steady.manoeuvred
    turned = seen(OWN, said=OWN + shaken)
    assert turned.observable
    assert turned.manoeuvred


def test_a_cone_tells_as_soon_as_a_bearing_does():
    both = seen(STEADY, cone=True)
    assert not both.observable
    assert not both.manoeuvred
    turned = seen(OWN, cone=True)
    assert turned.observable
    assert turned.manoeuvred
    assert 121.0 < turned.since_s < 200.0


def test_gaps_cost_information_and_nothing_else():
    whole, gappy = contact_of(OWN), contact_of(OWN)
    gappy.bearing_rad[1:-1][np.random.default_rng(1).random(799) < 0.7] = np.nan
    less, more = observe(gappy, bank_of(gappy)), observe(whole, bank_of(whole))
    assert less.observable
    assert 1.4 < less.range_sd_m / more.range_sd_m < 2.3  # about the root of 1 / 0.3


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_a_bearing_or_two_tell_nothing(steps):
    found = seen(OWN, steps=steps)
    assert not found.observable
    assert len(found.by_step) == steps
    assert found.range_sd_m == np.inf


def test_at_best_falls_as_own_ship_goes_on():
    best = [seen(OWN, steps=steps).at_best_percent for steps in (119, 141, 181, 401)]
    assert best[0] == np.inf
    assert best[1] > best[2] > best[3]
    contact = contact_of(OWN)
    late = observe(contact, bank_of(contact), position_sd_m=1e-3)
    away = np.hypot(*(TARGET[-1] - OWN[-1]))
    assert 0.5 < late.at_best_percent / (100.0 * late.range_sd_m / away) < 1.1


def test_at_best_is_of_targets_on_the_bearings_whatever_the_bank_believes():
    contact = contact_of(OWN)
    contact.bearing_rad[:40] = np.nan
    far = OWN[-1] + 10.0 * (TARGET[-1] - OWN[-1])
    astray = np.hstack([far, (far - TARGET[0]) / 800.0])  # began where the target did
    answer = observe(contact, believing([astray], [1.0]), position_sd_m=1e-3)
    assert answer.range_sd_m / np.hypot(*(far - OWN[-1])) > 0.02
    assert 0.2 < answer.at_best_percent < 0.6  # the truth's is 0.53


def test_at_best_is_the_bank_s_where_no_straight_track_is_on_the_bearings():
    contact, speed = contact_of(OWN), paper.TARGET * paper.heading(paper.COURSE)[::-1]
    contact.bearing_rad[:] += 20.0 * paper.SIGMA * np.sin(np.arange(801.0))
    truth = np.hstack([TARGET[-1], speed])
    answer = observe(contact, believing([truth], [1.0]), position_sd_m=1e-3)
    percent = 100.0 * answer.range_sd_m / np.hypot(*(TARGET[-1] - OWN[-1]))
    assert answer.at_best_percent == pytest.approx(percent, rel=1e-3)


def test_at_best_follows_a_cone_from_one_side_of_the_axis_to_the_other():
    contact, speed = contact_of(OWN, cone=True), paper.TARGET * paper.heading(paper.COURSE)[::-1]
    truth = np.hstack([TARGET[-1], speed])
    answer = observe(contact, believing([truth], [1.0]), position_sd_m=1e-3)
    # Tracks a little nearer, still on the bearings, are told better than the truth.
    assert (
        0.2
        < answer.at_best_percent
        < 0.9 * 100.0 * answer.range_sd_m / np.hypot(*(TARGET[-1] - OWN[-1]))
    )


def test_between_two_looks_it_is_what_it_was(monkeypatch):
    contact = contact_of(OWN)
    bank = bank_of(contact)
    seldom = observe(contact, bank)
    monkeypatch.setattr(observability, "CHECKS", 801)
    always = observe(contact, bank)
    changed = np.flatnonzero(np.diff(seldom.by_step[130:])) + 131
    assert 300 < len(changed) < 400
    np.testing.assert_array_equal(seldom.by_step[changed], always.by_step[changed])
    assert abs(seldom.since_s - always.since_s) <= 3.0


def test_cells_that_are_no_numbers_have_no_say():
    contact = contact_of(OWN)
    bank = bank_of(contact)
    means, weights = bank.means.copy(), bank.weights.copy()
    means[:, 0], weights[:, 0] = np.nan, 0.0
    assert observe(contact, replace(bank, means=means, weights=weights)).observable
    assert not observe(contact, replace(bank, means=np.full_like(means, np.nan))).observable


def test_settings_are_above_zero():
    contact = contact_of(OWN, steps=10)
    bank = bank_of(contact)
    with pytest.raises(UsageError, match="widest_percent"):
        observe(contact, bank, widest_percent=0.0)
    with pytest.raises(UsageError, match="position_sd_m"):
        observe(contact, bank, position_sd_m=-1.0)


def test_a_real_ship_on_a_steady_course_tells_no_range():
    if not TOWED.exists():
        pytest.skip("the towed array's files are not beside this checkout")
    bearings, _ = read_bearings(TOWED / "tdoa-tracks.mat")
    own_ship, _ = read_own_ship(TOWED / "own-ship.csv")
    found, _ = contacts(bearings, own_ship)
    assert len(found) == 43
    for contact in found[:10]:
        answer = observe(contact, bank_of(contact))
        assert not answer.observable
        assert not answer.manoeuvred

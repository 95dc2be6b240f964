"""The laws that a user's test-suite runs: good filters keep them, a broken one breaks its own."""

import re

import numpy as np
import pytest

import boresight as bs
from own_filters import BROKEN, FADING_EKF, FURTHER, NUMPY_EKF, update

RADAR = bs.Radar(range_m=30, azimuth_deg=0.1)
MOTION = bs.ConstantVelocity(accel_mps2=2, dims=2)
NAMES = [law.name for law in bs.testing.laws()]


@pytest.mark.parametrize("law", bs.testing.laws(), ids=str)
def test_a_user_s_filter_keeps(law):
    assert law(FADING_EKF)


@pytest.mark.parametrize("given", ["mekf", update, FADING_EKF], ids=["name", "formula", "filter"])
def test_all_laws_at_once(given):
    checked = bs.testing.check(given)
    assert checked.laws == tuple(NAMES)
    assert checked.refused == {}
    assert len(checked.worlds) == 6


def test_a_function_over_recordings_is_held_to_the_laws_that_need_no_steps():
    checked = bs.testing.check(NUMPY_EKF)
    assert checked.laws == tuple(name for name in NAMES if name not in ("formula", "stream"))


@pytest.mark.parametrize(("name", "broken"), [*BROKEN.items(), *FURTHER])
def test_a_broken_filter_breaks(name, broken):
    with pytest.raises(AssertionError, match=f"^faulty breaks the law {name!r}") as caught:
        bs.testing.check(broken, law=name)
    assert re.search(r"\n  found:   .+\n  where:   .+, seed \d+\n", str(caught.value))


def test_every_law_has_a_filter_that_breaks_it():
    assert set(BROKEN) == set(NAMES)


def test_a_message_repeats_the_fault():
    broken = BROKEN["whole turn"]
    with pytest.raises(AssertionError) as caught:
        bs.testing.check(broken, law="whole turn")
    call = re.search(r"repeat:  boresight\.testing\.(.*)", str(caught.value)).group(1)
    with pytest.raises(AssertionError) as again:
        eval(call, {"check": bs.testing.check, "FILTER": broken})  # noqa: S307 - our own message
    assert str(again.value) == str(caught.value)
    number = re.search(r"differs by ([\d.e-]+)", str(caught.value)).group(1)
    assert float(number) > 1e-9


def test_a_formula_that_fails_is_a_broken_law_with_its_error():
    def short(prior, z, components):
        return bs.Posterior(prior.mean[:-1], prior.cov, 0.0, 0.0, 0.0, z, components[0].sigma)

    with pytest.raises(AssertionError, match=r"breaks the law 'kalman'"):
        bs.testing.check(bs.Filter(name="short", formula=short))


def test_a_law_can_be_passed_over_and_a_world_can_be_the_user_s():
    assert "rotation" not in bs.testing.check("ckf", without=("rotation",)).laws
    world = bs.testing.World(MOTION, bs.Radar(range_m=5, azimuth_deg=2, range_rate_mps=1))
    checked = bs.testing.check("ckf", world=world)
    assert set(checked.laws) == {
        "missing plot", "covariance", "inputs", "formula", "batch", "stream"
    }  # fmt: skip


def test_worlds_that_a_filter_refuses_are_told():
    checked = bs.testing.check("kf")
    assert checked.worlds == ("positions in space", "positions in the plane")
    assert "range_m" in checked.refused["radar in the plane"]
    with pytest.raises(bs.UsageError, match="held to no law"):
        bs.testing.check("kf", world="radar in space")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"law": "whole tun"}, "did you mean 'whole turn'"),
        ({"world": "radar"}, "there is no world 'radar'"),
        ({"without": ("everything",)}, "there is no law"),
    ],
)
def test_an_unknown_law_or_world_is_refused(changed, said):
    with pytest.raises(bs.UsageError, match=said):
        bs.testing.check("ekf", **changed)


def believed(factor, seed=3, runs=200):
    """What a filter says that believes its radar's variances to be `factor` times the true ones."""
    scenario = bs.Scenario(
        name="level flight",
        motion=MOTION,
        sensor=RADAR,
        initial=[4e4, 1e4, -100, 20],
        prior_cov=np.diag([100.0**2] * 2 + [10.0**2] * 2),
        scans=40,
    )
    truth, plots = bs.simulate(scenario, RADAR, runs=runs, seed=seed)
    radar = bs.Radar(range_m=30 * factor**0.5, azimuth_deg=0.1 * factor**0.5)
    return bs.run("ekf", MOTION, radar, plots, outputs=("mean", "cov", "nis", "dof")), truth


def test_a_consistent_filter_is_called_so():
    """False alarm 1 % for the one seed there is."""
    found = bs.testing.assert_consistent(*believed(1.0))
    assert found["anees"].low < 1 < found["anees"].high
    assert found["anis"].low < 1 < found["anis"].high


@pytest.mark.parametrize(("factor", "said"), [(0.7, "too sure of itself"), (1.4, "too modest")])
def test_a_wrong_noise_is_found(factor, said):
    estimate, truth = believed(factor)
    for given in ((estimate, truth), (estimate,)):
        with pytest.raises(AssertionError, match=said):
            bs.testing.assert_consistent(*given)
    estimate.others.pop("dof")
    with pytest.raises(AssertionError, match=f"{said}: ANEES"):
        bs.testing.assert_consistent(estimate, truth)


def test_a_run_that_is_no_number_is_not_consistent():
    estimate, truth = believed(1.0)
    estimate.mean[7, -1, 0] = np.nan
    with pytest.raises(AssertionError, match="too sure of itself: ANEES inf"):
        bs.testing.assert_consistent(estimate, truth)


def test_what_cannot_be_tested_is_refused():
    estimate, truth = believed(1.0, runs=5)
    with pytest.raises(bs.UsageError, match="5 runs tell too little"):
        bs.testing.assert_consistent(estimate, truth)
    estimate.others.pop("nis")
    with pytest.raises(bs.UsageError, match="nothing to test"):
        bs.testing.assert_consistent(estimate)


@pytest.mark.slow
def test_the_false_alarm_is_what_was_asked():
    """400 consistent studies at 10 %: 95 % of such counts lie in 28 to 52; bands are within 1.5."""
    alarms = 0
    for seed in range(400):
        try:
            bs.testing.assert_consistent(*believed(1.0, seed=100 + seed, runs=50), false_alarm=0.1)
        except AssertionError:
            alarms += 1
    assert 20 <= alarms <= 60

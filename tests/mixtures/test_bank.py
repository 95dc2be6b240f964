"""The bank: fused step by step, or cell by cell and weighted afterwards; and what it begins from.

Kernels may fuse products, so both ways agree to 1e-12 of the scale of each number.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boresight as bs
from boresight.errors import UsageError
from boresight.filters import ekf
from boresight.filters.recursion import Recursion, run_recursion
from boresight.filters.steps import Updating
from boresight.lanes import pack_states
from boresight.maths import Gaussian
from boresight.maths.mixing import moments
from boresight.mixtures.bank import run_bank
from boresight.mixtures.range_parameterised import RangeParameterised, range_cells, starts
from boresight.mixtures.weights import weights_over_time
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import ConicalBearings, Pose, Radar
from mixtures.heard import (
    OWN,
    RELATIVE,
    SPEED_SD,
    bearings_from,
    earth_fixed,
    every_second,
    filtered,
    relative,
    start_of,
    straight,
    up,
)
from oracles import pradeep as paper

STEPS = 300
MEMBERS = ("ekf", "iekf", "mgekf", "ukf", "ckf")
FORESEEN = ("loglik", "innovation", "variance")
BEAM = np.radians(1.0)  # of a cone


def compared(bank, sensor, z, start):
    """Both ways, from the same cells to the last bit: an ulp would grow to 1e-12 in 300 steps."""
    motion, dt = straight(0.01), every_second(len(z))
    apart = run_bank(bank, motion, sensor, z[None], dt, start)
    outputs = ("mean", "cov", "nis", "dof", *FORESEEN, "kept_log_weights")
    recursion = Recursion(bank, motion, sensor)
    begun = recursion.states(start, 1)
    cells, _ = starts(bank, start, motion, sensor)
    values = {"log_weights": np.zeros((1, len(cells)))}
    for i, cell in enumerate(cells):
        values |= {f"{name}_{i}": part[None] for name, part in cell._asdict().items()}
        np.testing.assert_allclose(begun[f"mean_{i}"][0], cell.mean, rtol=1e-14)
        scale = np.max(np.abs(cell.cov))
        np.testing.assert_allclose(begun[f"cov_{i}"][0], cell.cov, atol=1e-14 * scale)
    begun = pack_states(begun.slots, values)
    fused = run_recursion(recursion, z[None], dt, begun, outputs=outputs)
    return apart, {name: fused.others[name][0] for name in outputs}


def foreseen(before, loglik, innovation, variance):
    """What a mixture foresaw, with the weights (steps, cells) before each bearing."""
    said = np.log(np.sum(before * np.exp(loglik), axis=-1))
    nu = np.einsum("sc,sck->sk", before, innovation)
    spread = variance + (innovation - nu[:, None]) ** 2
    return said, nu, np.einsum("sc,sck->sk", before, spread)


def mixed(bank):
    """Moments of a bank after every step."""
    return paper.mixture(bank.weights, bank.means, bank.covs)


def agree(apart, fused):
    share = np.exp(fused["kept_log_weights"])
    share /= share.sum(axis=-1, keepdims=True)
    assert np.max(np.abs(apart.weights - share)) < 1e-12
    mean, cov = mixed(apart)
    sd = np.sqrt(np.einsum("sii->si", cov))
    scale = np.max(np.abs(apart.means), axis=(0, 1)) + sd
    assert np.max(np.abs(fused["mean"] - mean) / scale) < 1e-12
    assert np.max(np.abs(fused["cov"] - cov) / (scale[:, None] * scale[..., None])) < 1e-12


@given(st.floats(10.0, 5e3), st.floats(1.5, 100.0), st.integers(1, 12))
def test_cells_cover_the_ranges_and_grow_alike(nearest, ratio, cells):
    """As ranges that are uniform in each: half as far again on either side of the middle."""
    middles, spreads = range_cells(nearest, ratio * nearest, cells)
    low, high = middles - spreads * np.sqrt(3.0), middles + spreads * np.sqrt(3.0)
    assert low[0] == pytest.approx(nearest)
    assert high[-1] == pytest.approx(ratio * nearest)
    np.testing.assert_allclose(low[1:], high[:-1])
    np.testing.assert_allclose(high / low, ratio ** (1.0 / cells))


def test_cells_that_overlap_are_wider_and_nothing_else():
    middles, spreads = RangeParameterised(overlap=1.5).ranges
    np.testing.assert_allclose(middles, RangeParameterised().ranges[0])
    np.testing.assert_allclose(spreads, 1.5 * RangeParameterised().ranges[1])


@given(st.floats(-3.1, 3.1), st.floats(0.01, 5.0), st.floats(-3.1, 3.1))
def test_each_cell_begins_on_the_bearing_at_its_own_range(bearing, sigma_deg, axis):
    """Whatever range the start had: the angle's spread counts, and lies across the bearing."""
    c, s = np.cos(axis), np.sin(axis)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    place = np.array([300.0, -700.0, 0.0])
    sensor = Radar(azimuth_deg=sigma_deg, pose=Pose(position_m=place, rotation=turn))
    bank = RangeParameterised(cells=4, nearest_m=500.0, farthest_m=9_000.0)
    start = bank.start(np.array([[bearing - axis]]), straight(), sensor, speed_mps=7.0)
    cells, side = starts(bank, Gaussian(start.mean[0], start.cov[0]), straight(), sensor)
    assert np.array_equal(side, np.zeros(4))
    along = np.array([np.cos(bearing), np.sin(bearing)])
    across = np.array([-along[1], along[0]])
    for cell, middle, spread in zip(cells, *bank.ranges, strict=True):
        np.testing.assert_allclose(cell.mean[:2], place[:2] + middle * along, rtol=1e-9)
        expected = spread**2 * np.outer(along, along)
        expected += (middle * np.radians(sigma_deg)) ** 2 * np.outer(across, across)
        np.testing.assert_allclose(cell.cov[:2, :2], expected, atol=1e-9 * middle**2)
        np.testing.assert_allclose(cell.cov[2:, 2:], 49.0 * np.eye(2))
        assert not np.any(cell.cov[:2, 2:])


@given(st.integers(0, 2**32))
def test_the_start_of_the_bank_is_the_mixture_of_its_cells(seed):
    generator = np.random.default_rng(seed)
    bank = RangeParameterised(cells=5)
    z, sensor = generator.uniform(-3.0, 3.0, (1, 1)), bearings_from(OWN[:1])
    whole = bank.start(z, straight(), sensor, speed_mps=9.0)
    cells, _ = starts(bank, Gaussian(whole.mean[0], whole.cov[0]), straight(), sensor)
    mixture = moments([0.2] * 5, cells)
    np.testing.assert_allclose(whole.mean[0], mixture.mean, rtol=1e-12)
    along = np.array([np.cos(z[0, 0]), np.sin(z[0, 0])])
    ours, theirs = (along @ cov[:2, :2] @ along for cov in (whole.cov[0], mixture.cov))
    assert ours == pytest.approx(theirs, rel=1e-12)


@pytest.mark.parametrize("prune", [0.0, 1e-3])
@pytest.mark.parametrize("member", MEMBERS)
def test_weights_afterwards_are_weights_step_by_step(member, prune):
    """With every third bearing missing at random."""
    z = paper.measured(RELATIVE, 1, seed=1)[:, :STEPS]
    z[0, 1:][np.random.default_rng(1).random(STEPS - 1) < 0.3] = np.nan
    start = earth_fixed(*(part[0] for part in start_of(z)), OWN)
    bank = RangeParameterised(member=member, prune=prune)
    apart, fused = compared(bank, bearings_from(OWN[:STEPS]), z[0, :, None], start)
    agree(apart, fused)
    assert (np.min(apart.weights[-1]) == 0.0) == (prune > 0.0)
    before = np.concatenate([np.full((1, 6), 1 / 6), apart.weights[:-1]])
    heard = np.isfinite(z[0])
    said, nu, variance = foreseen(before, apart.loglik, apart.innovation, apart.variance)
    np.testing.assert_allclose(fused["loglik"], said, atol=1e-9)
    np.testing.assert_allclose(fused["innovation"][heard], nu[heard], atol=1e-12)
    np.testing.assert_allclose(fused["variance"][heard], variance[heard], rtol=1e-9)
    assert np.all(np.isnan(fused["variance"][~heard]))
    square = np.where(heard, nu[:, 0] ** 2 / np.where(heard, variance[:, 0], 1.0), 0.0)
    np.testing.assert_allclose(fused["nis"], square, rtol=1e-8, atol=1e-12)
    assert np.array_equal(fused["dof"], heard)


def test_a_bearing_that_is_missing_moves_cells_but_no_weight():
    z = paper.measured(RELATIVE, 1, seed=2)[:, :STEPS]
    z[0, 200:260] = np.nan
    start = earth_fixed(*(part[0] for part in start_of(z)), OWN)
    sensor = bearings_from(OWN[:STEPS])
    found = run_bank(
        RangeParameterised(), straight(), sensor, z[..., None], every_second(STEPS), start
    )
    assert np.all(found.weights[200:260] == found.weights[199])
    assert np.all(found.covs[259, :, 0, 0] > found.covs[199, :, 0, 0])


def test_pruning_costs_nothing_of_accuracy():
    """RMSE of 300 runs, thresholds 0 and 1e-3: within one per cent from 150 to 800 s."""
    z = paper.measured(RELATIVE, 300, seed=3)
    start = earth_fixed(*start_of(z), OWN)
    error = {}
    for prune in (0.0, 1e-3):
        X = relative(filtered("rp-ekf", z, OWN, start, prune=prune).mean, OWN)
        square = np.sum((X[:, 150:, 2:] - RELATIVE[150:]) ** 2, axis=-1)
        error[prune] = np.sqrt(square.mean(axis=0))
    assert np.max(np.abs(error[1e-3] / error[0.0] - 1.0)) < 0.01


def test_any_filter_is_a_bank_of_one_cell():
    z = paper.measured(RELATIVE, 1, seed=4)[:, :STEPS]
    start = earth_fixed(*start_of(z), OWN)
    found = run_bank(
        Updating(formula=ekf.update),
        straight(),
        bearings_from(OWN[:STEPS]),
        z[..., None],
        every_second(STEPS),
        Gaussian(start.mean[0], start.cov[0]),
    )
    alone = filtered("ekf", z, OWN[:STEPS], start, outputs=("mean", "cov"))
    assert np.all(found.weights == 1.0)
    assert np.array_equal(found.side, [0.0])
    np.testing.assert_allclose(found.means[:, 0], alone.mean[0], rtol=1e-12)
    np.testing.assert_allclose(found.covs[:, 0], alone.cov[0], rtol=1e-9)


def test_the_best_cell_alone():
    z = paper.measured(RELATIVE, 1, seed=5)
    start = earth_fixed(*(part[0] for part in start_of(z)), OWN)
    bank = RangeParameterised(told="best cell")
    apart, fused = compared(bank, bearings_from(OWN), z[0, :, None], start)
    best = np.argmax(apart.weights, axis=-1)
    assert len(set(best)) > 1
    for name, each in (("mean", apart.means), ("cov", apart.covs)):
        told = np.stack([each[step, cell] for step, cell in enumerate(best)])
        scale = np.max(np.abs(each[1:]))
        np.testing.assert_allclose(
            fused[name][1:], told[1:], atol=1e-9 * scale
        )  # at 0 all are best


def array_of(own):
    """A line array towed along own ship's path, its axis along the course."""
    moves = np.diff(own, axis=0, append=2 * own[-1:] - own[-2:-1])
    course = np.arctan2(*moves.T)
    c, s, zero, one = np.cos(course), np.sin(course), 0 * course, 0 * course + 1
    turn = np.stack([c, s, zero, -s, c, zero, zero, zero, one], axis=-1).reshape(1, -1, 3, 3)
    pose = Pose(position_m=up(own), rotation=turn)
    return ConicalBearings(cone_deg=np.degrees(BEAM), pose=pose), course


def cones(own, steps, seed, side):
    """Sensor, plots (steps, 1) of the paper's target or its mirror, and the start."""
    sensor, course = array_of(own[:steps])
    target = RELATIVE[:steps] + OWN[:steps]
    if side == "starboard":  # the paper's is to the north of the first course, 090
        target = target * [1.0, -1.0]
    to = target - own[:steps]
    off = paper.wrap(np.arctan2(*to.T) - course)
    noise = BEAM * np.random.default_rng(seed).standard_normal(steps)
    z = np.abs(off + noise)[:, None]
    bank = RangeParameterised(cells=4)
    start = bank.start(z[:1], straight(), sensor, speed_mps=SPEED_SD)
    return sensor, z, Gaussian(start.mean[0], start.cov[0])


@pytest.mark.parametrize("member", ["ekf", "mgekf", "ukf", "ckf"])
@pytest.mark.parametrize("side", ["port", "starboard"])
def test_a_cone_keeps_both_sides_until_own_ship_turns(member, side):
    sensor, z, start = cones(OWN, STEPS, 7, side)
    bank = RangeParameterised(member=member, cells=4)
    apart, fused = compared(bank, sensor, z, start)
    agree(apart, fused)
    assert np.array_equal(apart.side, [1, -1] * 4)
    right, left = apart.weights[:, 0::2], apart.weights[:, 1::2]
    np.testing.assert_allclose(right[:120], left[:120], atol=1e-9)
    flip = np.array([-1.0, 1.0, -1.0, 1.0])  # the first course is due east
    np.testing.assert_allclose(apart.means[:120, 0::2], apart.means[:120, 1::2] * flip, atol=1e-6)
    kept = left if side == "port" else right
    assert kept[-1].sum() > 0.999


def test_a_member_that_is_not_finite_goes_as_if_it_had_never_been():
    z = paper.measured(RELATIVE, 1, seed=8)[:, :STEPS, None]
    sensor, motion, dt = bearings_from(OWN[:STEPS]), straight(), every_second(STEPS)
    bank = RangeParameterised(prune=0.0)
    recursion = Recursion(bank, motion, sensor)
    start = earth_fixed(*(part[0] for part in start_of(z[..., 0])), OWN)
    begun = recursion.states(start, 1)
    values = {slot.name: begun[slot.name].copy() for slot in begun.slots}
    values["cov_1"][:] = np.nan
    outputs = ("mean", "cov", "status", "kept_log_weights", *FORESEEN)
    ruined = run_recursion(recursion, z, dt, pack_states(begun.slots, values), outputs=outputs)
    assert not np.any(ruined.status)
    share = np.exp(ruined.kept_log_weights[0])
    share /= share.sum(axis=-1, keepdims=True)
    rest = [0, 2, 3, 4, 5]
    apart = run_bank(bank, motion, sensor, z, dt, start)
    kept = weights_over_time(apart.loglik[:, rest], prune=0.0)
    assert np.all(share[:, 1] == 0.0)
    np.testing.assert_allclose(share[:, rest], kept, atol=1e-9)
    before = np.concatenate([np.full((1, 5), 0.2), kept[:-1]])
    for found, expected in zip(
        (ruined.others[name][0] for name in FORESEEN),
        foreseen(before, *(getattr(apart, name)[:, rest] for name in FORESEEN)),
        strict=True,
    ):
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-9)
    mean, cov = paper.mixture(kept, apart.means[:, rest], apart.covs[:, rest])
    np.testing.assert_allclose(ruined.mean[0], mean, atol=1e-9 * np.max(np.abs(mean)))
    np.testing.assert_allclose(ruined.cov[0], cov, atol=1e-9 * np.max(np.abs(cov)))


@pytest.mark.parametrize("member", [*MEMBERS, "modified-polar"])
def test_a_cell_is_the_filter_of_its_name(member):
    z = paper.measured(RELATIVE, 1, seed=9)[:, :STEPS]
    start = earth_fixed(*(part[0] for part in start_of(z)), OWN)
    motion, sensor = straight(), bearings_from(OWN[:STEPS])
    bank = RangeParameterised(member=member, cells=1)
    one = run_bank(bank, motion, sensor, z[..., None], every_second(STEPS), start)
    (cell,), _ = starts(bank, start, motion, sensor)
    alone = filtered(member, z, OWN[:STEPS], cell, outputs=("mean", "cov"))
    scale = np.max(np.abs(alone.cov), axis=(1, 2, 3))
    np.testing.assert_allclose(one.means[:, 0], alone.mean[0], rtol=1e-9, atol=1e-9)
    assert np.max(np.abs(one.covs[:, 0] - alone.cov[0]) / scale) < 1e-12


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"member": "kf"}, "member"),
        ({"told": "all"}, "told"),
        ({"cells": 0}, "cells"),
        ({"cells": 2.5}, "cells"),
        ({"nearest_m": 0.0}, "range cells"),
        ({"nearest_m": 3e4}, "range cells"),
        ({"farthest_m": np.inf}, "range cells"),
        ({"farthest_m": np.nan}, "range cells"),
        ({"overlap": 0.0}, "overlap"),
        ({"overlap": np.nan}, "overlap"),
        ({"prune": 1.0}, "prune"),
        ({"prune": -0.1}, "prune"),
        ({"prune": np.nan}, "prune"),
    ],
)
def test_settings_that_make_no_bank(settings, said):
    with pytest.raises(UsageError, match=said):
        RangeParameterised(**settings)


def test_a_bank_needs_a_bearing():
    with pytest.raises(UsageError, match="no use for range_m"):
        RangeParameterised().start(
            np.ones((1, 1)), ConstantVelocity(accel_mps2=0.0, dims=2), Radar(range_m=3.0)
        )


def test_cells_that_overlap_are_as_much_wider_and_begin_in_the_same_places():
    plain, wide = (RangeParameterised(overlap=o).ranges for o in (1.0, 1.5))
    assert np.array_equal(wide[0], plain[0])
    assert np.array_equal(wide[1], 1.5 * plain[1])


@pytest.mark.parametrize("overlap", [0.0, -1.0, np.inf, np.nan])
def test_an_overlap_is_above_zero_and_finite(overlap):
    with pytest.raises(UsageError, match="overlap"):
        RangeParameterised(overlap=overlap)


@pytest.mark.parametrize(
    ("motion", "sensor", "said"),
    [
        (2, bs.Radar(range_m=30.0, azimuth_deg=1.0), "no use for range_m"),
        (2, bs.Radar(range_rate_mps=1.0), "no use for range_rate"),
        (3, bs.Bearings(azimuth_deg=1.0), "3 dimensions"),
    ],
)
def test_a_bank_is_for_bearings_in_the_plane(motion, sensor, said):
    plane = bs.ConstantVelocity(accel_mps2=0.0, dims=motion)
    plots = np.full((2, 4, len(sensor.names)), 0.3)
    with pytest.raises(bs.UsageError, match=said):
        bs.run("rp-ekf", plane, sensor, plots, dt=1.0)

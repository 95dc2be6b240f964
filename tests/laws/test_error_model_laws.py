"""Laws of the error model: what it must equal, and what must not matter to it.

The oracle is a textbook Kalman filter in matrices, on differences that this file makes itself.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.filters import error_step
from boresight.filters.error_beside import Case
from boresight.filters.error_model import correct
from boresight.models.error_model import MODELS, ErrorModel
from boresight.models.sensors import Pose, Radar
from oracles.textbook import kalman_update, polar, residual, white_acceleration

seeds = st.integers(0, 2**32)
SIGMA = np.array([30.0, np.radians(1.5), np.radians(1.0)])
RADAR = Radar(range_m=30, azimuth_deg=1.5, elevation_deg=1.0)
PLAIN = ErrorModel(odds=None, alarm=None)
RATE = ErrorModel(state="rate", drift_m=0.4, drift_deg=0.3, odds=None, alarm=None)
BOTH = ["polar", "cartesian"]


def world(seed, runs=2, scans=25, gaps=0.3):
    """Plots, references with gaps, and steps of unequal length."""
    rng = np.random.default_rng(seed)
    place = rng.normal(0, 3_000, (runs, 1, 3)) + rng.normal(0, 50, (runs, scans, 3)).cumsum(1)
    z = np.array([[polar(x) for x in run] for run in place])
    z += SIGMA * (rng.standard_normal(z.shape) + rng.normal(0, 2, (runs, 1, 3)))
    place[rng.random((runs, scans)) < gaps] = np.nan
    return z, place, rng.uniform(0.1, 3.0, (runs, scans))


def point(z):
    r, az, el = z
    return r * np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])


def point_cov(z, step=1e-5):
    """J R J' by central differences."""
    scale = np.array([1e3, 1.0, 1.0]) * step
    J = np.stack([(point(z + e) - point(z - e)) / (2 * e.sum()) for e in np.diag(scale)], axis=1)
    return J @ np.diag(SIGMA**2) @ J.T


def differences(z, place, frame):
    """dZ (scans, 3) and nominal covariances (scans, 3, 3) of one run."""
    if frame == "polar":
        dz = [residual(polar(x), plot.copy()) for x, plot in zip(place, z, strict=True)]
        return np.array(dz), np.broadcast_to(np.diag(SIGMA**2), (len(z), 3, 3))
    return place - [point(plot) for plot in z], np.array([point_cov(plot) for plot in z])


def textbook(dz, variance, dt, drift, model):
    """Errors as predicted and as estimated, (scans, 2), and their variances, of one channel."""
    n = 1 if model.state == "bias" else 2
    mean, cov, rows = np.zeros(n), None, []
    for difference, r, step in zip(dz, variance, dt, strict=True):
        gone = np.isnan(difference)
        if cov is None:
            cov = np.diag([model.spread**2, model.rate_spread**2][:n]) * r
        else:
            F, Q = white_acceleration(1, step, drift**2)
            if n == 1:
                F, Q = np.eye(1), np.array([[drift**2 * step]])
            mean = mean if gone and model.outage == "hold" else F @ mean
            cov = F @ cov @ F.T + Q
        before = mean[0], cov[0, 0]
        if not gone:
            H, nu = np.eye(n)[:1], np.array([difference - mean[0]])
            mean, cov = kalman_update(mean, cov, nu, H, np.array([[r]]))
        rows.append((before, (mean[0], cov[0, 0])))
        cov = None if np.isnan(dz[: len(rows)]).all() else cov  # no reference yet: still the widest
    return np.swapaxes(rows, 0, 1)  # (before or after, scans, mean or variance)


@given(seed=seeds)
@pytest.mark.parametrize(
    ("frame", "state", "correction", "outage"),
    [
        ("polar", "bias", "prediction", "hold"),
        ("polar", "rate", "same epoch", "coast"),
        ("polar", "rate", "prediction", "hold"),
        ("polar", "rate", "same epoch", "zero"),
        ("cartesian", "bias", "prediction", "zero"),
        ("cartesian", "rate", "same epoch", "coast"),
    ],
)
def test_every_channel_is_a_textbook_kalman_filter(frame, state, correction, outage, seed):
    z, place, dt = world(seed)
    model = replace(RATE, frame=frame, state=state, correction=correction, outage=outage)
    found = correct(z, place, dt, RADAR, model=model)
    drifts = [0.4, *np.radians([0.3, 0.3])] if frame == "polar" else [0.4] * 3
    for run in range(len(z)):
        dz, noise = differences(z[run], place[run], frame)
        for i, drift in enumerate(drifts):
            rows = textbook(dz[:, i], noise[:, i, i], dt[run], drift, model)
            mean, variance = rows[int(correction == "same epoch")].T
            if outage == "zero":
                there = ~np.isnan(dz[:, i])
                variance, mean = variance + (mean * ~there) ** 2, mean * there
            scale = np.sqrt(noise[:, i, i].max())
            np.testing.assert_allclose(found.error[run, :, i], mean, rtol=0, atol=1e-6 * scale)
            np.testing.assert_allclose(found.error_cov[run, :, i, i], variance, rtol=1e-6)


@given(seed=seeds)
@pytest.mark.parametrize("frame", BOTH)
def test_a_corrected_plot_is_the_plot_plus_the_error(frame, seed):
    z, place, dt = world(seed)
    found = correct(z, place, dt, RADAR, model=replace(PLAIN, frame=frame))
    plain = z if frame == "polar" else np.array([[point(plot) for plot in run] for run in z])
    off = found.z - plain - found.error
    if frame == "polar":
        off[..., 1:] = np.angle(np.exp(1j * off[..., 1:]))
    assert np.abs(off).max() < 1e-8
    assert np.abs(found.error).max() > 1e-3


@given(seed=seeds)
@pytest.mark.parametrize("frame", BOTH)
@pytest.mark.parametrize("name", ["kashyap", "random walk"])
def test_many_lanes_are_one_lane_many_times_bit_for_bit(name, frame, seed):
    z, place, dt = world(seed, runs=11)
    dt = dt[:1]  # one rate for one lane and for many: one program
    together = correct(z, place, dt, RADAR, model=name, frame=frame, threads=2)
    for i in (0, 7, 8, 10):
        alone = correct(z[i : i + 1], place[i : i + 1], dt, RADAR, model=name, frame=frame)
        for one, other in zip(alone, together, strict=True):
            if isinstance(one, np.ndarray):
                np.testing.assert_array_equal(one[0], other[i])


@given(seed=seeds)
@pytest.mark.parametrize("frame", BOTH)
@pytest.mark.parametrize("model", [MODELS["kashyap"], ErrorModel()], ids=["kashyap", "default"])
def test_the_kernel_gives_what_the_formula_gives_on_floats(model, frame, seed):
    z, place, dt = world(seed, runs=1, scans=14)
    model = replace(model, frame=frame)
    found = correct(z, place, dt, RADAR, model=model)
    case = Case(model, RADAR, 3)
    state = {name: np.zeros(leaf.shape) for name, leaf in error_step.layout(case).items()}
    for k in range(z.shape[1]):
        inputs = {"z": z[0, k], "reference": place[0, k], "dt": dt[0, k]}
        state, told = error_step.step(case, state, inputs)
        for name, value in told.items():
            other = getattr(found, name)[0, k]
            atol = 1e-9 * max(1e-6, np.nanmax(np.abs(value)))
            np.testing.assert_allclose(other, np.asarray(value, dtype=float), rtol=1e-9, atol=atol)


@given(seed=seeds, scan=st.integers(1, 20))
@pytest.mark.parametrize("frame", BOTH)
@pytest.mark.parametrize("model", [ErrorModel(window=4), PLAIN], ids=["doubted", "always"])
def test_a_scan_without_reference_lets_time_pass_and_nothing_else(model, frame, scan, seed):
    """Left out, with its time given to the next scan, nothing later is told apart."""
    z, place, dt = world(seed, gaps=0.0)
    place[:, scan] = np.nan
    whole = correct(z, place, dt, RADAR, model=model, frame=frame)
    merged = dt.copy()
    merged[:, scan + 1] += dt[:, scan]
    without = (np.delete(each, scan, axis=1) for each in (z, place, merged))
    part = correct(*without, RADAR, model=model, frame=frame)
    for name in ("error", "error_cov", "noise_cov", "probability"):
        left = np.delete(getattr(whole, name), scan, axis=1)
        np.testing.assert_allclose(left, getattr(part, name), rtol=1e-7, atol=1e-12)


@given(seed=seeds, turns=st.integers(-3, 3))
@pytest.mark.parametrize("name", MODELS)
def test_a_whole_turn_changes_nothing(name, turns, seed):
    z, place, dt = world(seed)
    turned = z.copy()
    turned[:, ::2, 1] += turns * 2 * np.pi
    one, other = (correct(each, place, dt, RADAR, model=name) for each in (z, turned))
    for field in ("error", "probability", "noise_cov"):
        a, b = getattr(one, field), getattr(other, field)
        np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-8)
    assert np.abs(np.angle(np.exp(1j * (one.z - other.z)[..., 1]))).max() < 1e-9
    assert np.abs(other.z[..., 1]).max() <= np.pi


@given(seed=seeds)
@pytest.mark.parametrize("model", ["kashyap", replace(MODELS["kashyap"], correction="prediction")])
def test_a_diagonal_window_is_the_variance_of_the_last_differences(model, seed):
    """Of each channel by itself: an azimuth that is missing does not stop the range."""
    z, place, dt = world(seed, runs=2, scans=30)
    z[np.random.default_rng(seed).random(z.shape) < 0.2] = np.nan
    found = correct(z, place, dt, RADAR, model=model)
    late = 0 if model == "kashyap" else 1  # a prediction knows nothing of the present scan
    for run in range(2):
        dz, noise = differences(z[run], place[run], "polar")
        for k in range(30):
            for i in range(3):
                seen = dz[: k + 1 - late, i]
                last = seen[~np.isnan(seen)][-10:]
                expected = np.var(last, ddof=1) if len(last) == 10 else noise[k, i, i]
                np.testing.assert_allclose(found.noise_cov[run, k, i, i], expected, rtol=1e-9)
        off = found.noise_cov[run] * (1 - np.eye(3))
        assert not off.any()


@given(seed=seeds, floor=st.floats(0, 1))
def test_a_full_window_is_the_covariance_of_the_last_whole_differences(floor, seed):
    z, place, dt = world(seed, runs=2, scans=30)
    place[:, ::7, 2] = np.nan  # a reference without height
    model = ErrorModel(
        frame="cartesian", noise="full", window=8, warm_up=5, floor=floor, correction="same epoch"
    )
    found = correct(z, place, dt, RADAR, model=model)
    for run in range(2):
        dz, noise = differences(z[run], place[run], "cartesian")
        for k in range(30):
            last = dz[: k + 1][~np.isnan(dz[: k + 1]).any(-1)][-8:]
            expected = noise[k]
            if len(last) >= 5:
                expected = (1 - floor) * np.cov(last.T) + floor * noise[k]
            scale = np.abs(expected).max()
            np.testing.assert_allclose(
                found.noise_cov[run, k], expected, rtol=1e-6, atol=1e-7 * scale
            )


@given(seed=seeds)
@pytest.mark.parametrize("source", ["innovation", "residual"])
def test_a_window_of_innovations_or_residuals(source, seed):
    z, place, dt = world(seed, runs=1, scans=30, gaps=0.0)
    model = replace(RATE, window=6, source=source, correction="same epoch")
    found = correct(z, place, dt, RADAR, model=model)
    dz, noise = differences(z[0], place[0], "polar")
    for i, drift in enumerate([0.4, *np.radians([0.3, 0.3])]):
        rows = textbook(dz[:, i], noise[:, i, i], dt[0], drift, model)
        left = dz[:, i] - rows[int(source == "residual"), :, 0]
        expected = [np.var(left[k - 5 : k + 1], ddof=1) for k in range(5, 30)]
        np.testing.assert_allclose(found.noise_cov[0, 5:, i, i], expected, rtol=1e-5)


@given(seed=seeds)
def test_a_missing_component_leaves_the_others_alone(seed):
    z, place, dt = world(seed)
    holes = z.copy()
    holes[:, ::3, 1] = np.nan
    whole, part = (correct(each, place, dt, RADAR) for each in (z, holes))
    for i in (0, 2):
        np.testing.assert_array_equal(part.z[..., i], whole.z[..., i])
        np.testing.assert_array_equal(part.error_cov[..., i, i], whole.error_cov[..., i, i])
    assert np.isnan(part.z[:, ::3, 1]).all()
    assert np.isfinite(part.error).all()


@given(seed=seeds)
def test_the_probability_of_a_bias_is_by_bayes_rule(seed):
    """Without drift the differences are jointly normal under both hypotheses."""
    from scipy.stats import multivariate_normal

    z, place, dt = world(seed, runs=1, scans=12)
    model = ErrorModel(drift_m=0, drift_deg=0, spread=3.0, odds=20.0, alarm=None)
    found = correct(z, place, dt, RADAR, model=model)
    dz, _ = differences(z[0], place[0], "polar")
    for i, k in ((0, 11), (1, 5), (2, 11)):
        x = dz[:k, i][~np.isnan(dz[:k, i])]  # before this scan
        logs = np.zeros(2)
        if len(x):
            cov = SIGMA[i] ** 2 * np.eye(len(x))
            wide = cov + (3.0 * SIGMA[i]) ** 2
            logs = [multivariate_normal(cov=c).logpdf(x) for c in (wide, cov)]
        ratio = np.exp(min(logs[0] - logs[1], 30.0))
        np.testing.assert_allclose(found.probability[0, k, i], ratio / (ratio + 20.0), rtol=1e-6)


@given(seed=seeds, limit=st.floats(1.0, 4.0))
def test_an_alarm_is_pages_test_on_normalised_innovations(limit, seed):
    """By hand: sums that start anew at 0, and a filter that starts anew at the alarm."""
    z, place, dt = world(seed, runs=1, scans=60, gaps=0.0)
    z[0, 30:, 0] += 100.0
    found = correct(z, place, dt, RADAR, model=ErrorModel(odds=20.0, alarm=limit))
    dz, _ = differences(z[0], place[0], "polar")
    mean, variance, up, down, evidence, alarms = 0.0, None, 0.0, 0.0, 0.0, 0
    for k in range(60):
        variance = 9e4 if variance is None else variance + 0.05**2 * dt[0, k]
        p = 1 / (1 + 20 * np.exp(-evidence))
        np.testing.assert_allclose(found.probability[0, k, 0], p, rtol=1e-6)
        np.testing.assert_allclose(found.error[0, k, 0], p * mean, atol=1e-6)
        spread = p * variance + p * (1 - p) * mean**2  # of an error that may be none
        np.testing.assert_allclose(found.error_cov[0, k, 0, 0], spread, rtol=1e-6)
        s, nu = variance + 900.0, dz[k, 0] - mean
        evidence += 0.5 * (dz[k, 0] ** 2 / 900 - nu**2 / s - np.log(s / 900))
        evidence = min(evidence, 30.0)
        up, down = (max(0.0, t + d * nu / np.sqrt(s) - 0.5) for t, d in ((up, 1), (down, -1)))
        mean, variance = mean + variance / s * nu, variance * 900.0 / s
        if max(up, down) > limit:
            variance, up, down, alarms = None, 0.0, 0.0, alarms + 1
            evidence = max(evidence, 0.0)
    assert alarms


@given(seed=seeds, sign=st.sampled_from([-1, 1]))
def test_a_radar_that_looks_the_other_way_is_found_out(seed, sign):
    """An azimuth off by half a turn: differences of either sign are one error."""
    z, place, dt = world(seed, runs=1, scans=60, gaps=0.0)
    z[..., 1] += sign * np.pi
    model = replace(PLAIN, window=20, source="innovation", correction="same epoch")
    found = correct(z, place, dt, RADAR, model=model)
    bias = np.exp(1j * found.error[0, -10:, 1])
    truth = differences(z[0], place[0], "polar")[0][:, 1]
    assert np.abs(np.angle(bias / np.exp(1j * truth).sum())).max() < SIGMA[1]
    assert found.noise_cov[0, -1, 1, 1] < 4 * SIGMA[1] ** 2


@given(seed=seeds)
def test_where_the_radar_stands_and_looks_does_not_matter(seed):
    z, place, dt = world(seed)
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    turn = turn * np.sign(np.linalg.det(turn))
    origin = np.array([900.0, -400.0, 70.0])
    posed = replace(RADAR, pose=Pose(position_m=origin, rotation=turn))
    moved = place @ turn + origin
    one, other = correct(z, place, dt, RADAR), correct(z, moved, dt, posed)
    np.testing.assert_allclose(one.z, other.z, rtol=1e-9, atol=1e-9)
    full = ErrorModel(frame="cartesian", noise="full", correction="none", window=5)
    one, other = correct(z, place, dt, RADAR, model=full), correct(z, moved, dt, posed, model=full)
    np.testing.assert_allclose(one.z @ turn + origin, other.z, rtol=1e-9, atol=1e-6)
    rotated = turn.T @ one.noise_cov @ turn
    np.testing.assert_allclose(
        rotated, other.noise_cov, rtol=1e-6, atol=1e-9 * np.abs(rotated).max()
    )


@given(seed=seeds)
def test_the_references_own_noise_is_seen_through_the_geometry(seed):
    """50 m along each axis are 50 / (r cos el) of azimuth and 50 / r of elevation."""
    z, place, dt = world(seed, runs=1, scans=1, gaps=0.0)
    model = replace(PLAIN, reference_m=50.0, correction="same epoch")
    found = correct(z, place, dt, RADAR, model=model)
    r, _, el = polar(place[0, 0])
    blur = 50.0**2 / np.array([1.0, r * np.cos(el), r]) ** 2
    wide, noise = (10 * SIGMA) ** 2, SIGMA**2 + blur
    expected = wide * noise / (wide + noise)
    np.testing.assert_allclose(np.diag(found.error_cov[0, 0]), expected, rtol=1e-9)


@given(seed=seeds)
def test_inputs_are_left_as_they_were(seed):
    given_in = world(seed)
    copies = [each.copy() for each in given_in]
    correct(*given_in, RADAR, model="kashyap")
    for one, other in zip(given_in, copies, strict=True):
        np.testing.assert_array_equal(one, other)

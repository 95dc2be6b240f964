"""What a mixture says of range, bearing, course and speed: laws, and draws from it."""

from dataclasses import replace

import numpy as np
import pytest

from boresight.maths import Gaussian
from boresight.mixtures.bank import Bank
from boresight.target_motion.contact import Contact
from boresight.target_motion.moments import polar_moments
from boresight.target_motion.quantities import as_polar, describe, history, regions
from boresight.target_motion.regions import highest_density, normal_ends

HERE = np.array([300.0, -200.0])
NAMES = ("range_m", "bearing_deg", "course_deg", "speed_mps")


def turned(angle):
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


def ellipse(long, short, angle):
    return turned(angle) @ np.diag([long**2, short**2]) @ turned(angle).T


def mixture(*cells):
    """Weights, means and covariances of (weight, position, its cov, velocity, its cov)."""
    weights = np.array([w for w, *_ in cells], dtype=float)
    means = np.array([[*x, *v] for _, x, _, v, _ in cells], dtype=float)
    covs = np.zeros((len(cells), 4, 4))
    for cov, (_, _, place, _, velocity) in zip(covs, cells, strict=True):
        cov[:2, :2], cov[2:, 2:] = place, velocity
    return weights / weights.sum(), means, covs


FAR = mixture((1, (4_000, 3_000), ellipse(90, 8, 0.7), (9, -12), ellipse(0.3, 0.1, 1.0)))
SPREAD = mixture(
    (5, (1_500, 900), ellipse(200, 9, 0.5), (3, 10), ellipse(9, 0.6, 0.5)),
    (3, (4_000, 2_500), ellipse(500, 25, 0.6), (-2, 14), ellipse(8, 1.5, 0.6)),
    (2, (9_000, 5_600), ellipse(1_200, 60, 0.6), (2, -1), ellipse(11, 10, 0.9)),
)
ON_TOP = mixture((1, HERE, ellipse(100, 60, 0.3), (0.1, 0.0), ellipse(2, 1, 0.3)))
ALL = {"far": FAR, "spread": SPREAD, "on top": ON_TOP}


def draws(mix, count, seed=1):
    """States (count, 4) from a mixture."""
    generator, (weights, means, covs) = np.random.default_rng(seed), mix
    cell = generator.choice(len(weights), size=count, p=weights)
    roots = np.linalg.cholesky(covs)
    return means[cell] + np.einsum("nij,nj->ni", roots[cell], generator.normal(size=(count, 4)))


def around(angle, centre):
    return (angle - centre + 180.0) % 360.0 - 180.0


def covered(values, pieces, turn=None):
    """Share of values in intervals."""
    inside = np.zeros(len(values), dtype=bool)
    for low, high in pieces:
        inside |= (
            (values - low) % turn <= high - low if turn else (low <= values) & (values <= high)
        )
    return inside.mean()


def test_polar_columns_of_a_state():
    states = np.array([[3.0, 4.0, 0.0, -2.0], [-1.0, 0.0, 5.0, 0.0]])
    expected = [[5.0, np.degrees(np.arctan2(4.0, 3.0)), 270.0, 2.0], [1.0, 180.0, 0.0, 5.0]]
    assert as_polar(states, np.zeros(2)) == pytest.approx(np.array(expected))


def test_one_narrow_cell_far_away_is_linear():
    estimate, sd = polar_moments(*FAR, np.zeros(2))
    assert estimate == pytest.approx(
        [5_000.0, np.degrees(np.arctan2(3, 4)), 306.87, 15.0], rel=1e-3
    )
    _, means, covs = FAR
    for i, j, x, cov in (
        (0, 1, means[0, :2], covs[0, :2, :2]),
        (3, 2, means[0, 2:], covs[0, 2:, 2:]),
    ):
        r = np.hypot(*x)
        along, across = x / r, np.array([-x[1], x[0]]) / r
        assert sd[i] == pytest.approx(np.sqrt(along @ cov @ along), rel=2e-3)
        assert sd[j] == pytest.approx(np.degrees(np.sqrt(across @ cov @ across) / r), rel=2e-3)


@pytest.mark.parametrize(("name", "loose"), [("far", 0.003), ("spread", 0.03), ("on top", 0.11)])
def test_moments_are_those_of_draws(name, loose):
    """Of a million draws; the rule is worst, by a tenth of the spread, for a cell at the origin."""
    estimate, sd = polar_moments(*ALL[name], HERE)
    drawn = as_polar(draws(ALL[name], 1_000_000), HERE)
    for i in range(4):
        off = around(drawn[:, i], estimate[i]) if i in (1, 2) else drawn[:, i] - estimate[i]
        if i in (0, 3) or sd[i] < 45.0:  # what points everywhere has no mean direction
            assert abs(off.mean()) < loose * sd[i]
        assert sd[i] == pytest.approx(np.sqrt(np.mean((off - off.mean()) ** 2)), rel=loose)


@pytest.mark.parametrize("name", ALL)
def test_turning_everything_turns_the_angles(name):
    (weights, means, covs), angle = ALL[name], 1.234
    R = np.kron(np.eye(2), turned(angle))
    before = polar_moments(weights, means, covs, HERE)
    after = polar_moments(weights, means @ R.T, R @ covs @ R.T, turned(angle) @ HERE)
    shift = np.array([0.0, np.degrees(angle), np.degrees(angle), 0.0])
    off = after[0] - before[0] - shift
    off[1:3] = np.where(before[1][1:3] < 90.0, around(off[1:3], 0.0), 0.0)  # else: no direction
    # A round cell has no axes of its own: it turns as well as the rule is.
    assert np.all(np.abs(off) < 0.02 * before[1])
    assert after[1] == pytest.approx(before[1], rel=0.02)


def test_the_mirror_image_has_the_angles_on_the_other_side():
    weights, means, covs = SPREAD
    flip = np.diag([1.0, -1.0, 1.0, -1.0])
    before = polar_moments(weights, means, covs, HERE)
    after = polar_moments(weights, means @ flip, flip @ covs @ flip, HERE * [1.0, -1.0])
    assert after[0][[0, 3]] == pytest.approx(before[0][[0, 3]])
    assert around(after[0][1:3] + before[0][1:3], 0.0) == pytest.approx(0.0, abs=1e-6)
    assert after[1] == pytest.approx(before[1])


def test_a_mean_of_bearings_on_either_side_of_north_is_north():
    narrow = ellipse(10, 10, 0)
    mix = mixture(
        (1, (1_000, 200), narrow, (5, 1), narrow), (1, (1_000, -200), narrow, (5, 1), narrow)
    )
    estimate, sd = polar_moments(*mix, np.zeros(2))
    assert around(estimate[1], 0.0) == pytest.approx(0.0, abs=1e-6)
    assert sd[1] == pytest.approx(np.hypot(np.degrees(np.arctan(0.2)), np.degrees(0.01)), rel=0.01)


def test_a_mean_of_directions_is_that_of_the_angles_and_not_of_their_vectors():
    """Nine tenths on 0 and one on 60 degrees: the vectors' mean points to 5.2, the angles' is 6."""
    narrow, slow = ellipse(1, 1, 0), ellipse(1e-2, 1e-2, 0)
    turn = np.array([0.5, np.sqrt(0.75)])
    mix = mixture(
        (9, (1_000, 0), narrow, (10, 0), slow), (1, 1_000 * turn, narrow, 10 * turn, slow)
    )
    estimate, sd = polar_moments(*mix, np.zeros(2))
    assert estimate[1:3] == pytest.approx([6.0, 6.0], abs=1e-3)
    assert sd[1:3] == pytest.approx(60.0 * np.sqrt(0.09), abs=1e-2)


def test_cells_that_are_gone_may_hold_anything():
    weights, means, covs = SPREAD
    more = np.append(weights, 0.0)
    means = np.append(means, np.full((1, 4), np.nan), axis=0)
    covs = np.append(covs, np.full((1, 4, 4), np.nan), axis=0)
    found, expected = polar_moments(more, means, covs, HERE), polar_moments(*SPREAD, HERE)
    assert np.array_equal(found, expected)
    assert regions(more, means, covs, HERE) == regions(*SPREAD, HERE)


def test_leading_axes_are_one_after_the_other():
    weights, means, covs = (np.stack([a, a[::-1]])[None] for a in SPREAD)
    estimate, sd = polar_moments(weights, means, covs, np.stack([HERE, HERE]))
    one = polar_moments(*SPREAD, HERE)
    assert estimate == pytest.approx(np.broadcast_to(one[0], (1, 2, 4)))
    assert sd == pytest.approx(np.broadcast_to(one[1], (1, 2, 4)))


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("level", [50, 90, 99])
def test_regions_hold_what_they_say(name, level):
    """Of 200,000 draws 0.1 % is a standard error at 50 %; the grid is worth as much."""
    found, drawn = regions(*ALL[name], HERE), as_polar(draws(ALL[name], 200_000, seed=2), HERE)
    for i, quantity in enumerate(NAMES):
        share = covered(drawn[:, i], found[quantity][f"{level}"], 360.0 if i in (1, 2) else None)
        assert share == pytest.approx(level / 100.0, abs=6e-3), quantity


def test_regions_of_cells_apart_come_in_pieces_and_are_the_shortest():
    found = regions(*SPREAD, HERE)["range_m"]
    drawn = as_polar(draws(SPREAD, 1_000_000, seed=3), HERE)[:, 0]
    counts, _ = np.histogram(drawn, bins=np.arange(0.0, drawn.max() + 20.0, 20.0))
    order = np.sort(counts)[::-1].cumsum()
    for level in (50, 90):
        pieces = found[f"{level}"]
        length = sum(high - low for low, high in pieces)
        bins = np.searchsorted(order, level / 100.0 * order[-1]) + 1
        assert length == pytest.approx(20.0 * bins, rel=0.03)
    assert len(found["90"]) > 1


def test_a_density_that_rises_in_a_line_is_cut_by_its_square():
    """Above f of a triangle lies 1 - f² of it; and a straight line needs no finer grid."""
    for grid in (np.array([0.0, 1.0]), np.linspace(0.0, 1.0, 7)):
        (low,), (high,) = highest_density(grid, 3.0 * grid, [75, 36])
        assert low == pytest.approx([0.5, 1.0], abs=1e-6)
        assert high == pytest.approx([0.8, 1.0], abs=1e-6)


def test_ends_of_a_normal_distribution_are_its_quantiles():
    weights, means, sds = np.array([[1.0], [1.0]]), np.array([[3e3], [-2.0]]), [[100.0], [0.1]]
    for level, sd in ((50, 0.67449), (90, 1.64485)):
        low, high = normal_ends(weights, means, np.array(sds), level)
        assert (means - low[:, None]) / sds == pytest.approx(np.full((2, 1), sd), rel=0.02)
        assert (high[:, None] - means) / sds == pytest.approx(np.full((2, 1), sd), rel=0.02)


def test_a_region_across_north_runs_past_360():
    narrow = ellipse(10, 10, 0)
    mix = mixture((1, (1_000, 0), narrow, (5, 0), ellipse(0.1, 0.1, 0)))
    for name in ("bearing_deg", "course_deg"):
        ((low, high),) = regions(*mix, np.zeros(2))[name]["90"]
        assert low == pytest.approx(360.0 - (high - 360.0), abs=0.02 * (high - low))
        assert 360.0 < high < 365.0


def test_a_direction_that_is_unknown_has_the_share_of_the_circle():
    mix = mixture((1, (0, 0), ellipse(10, 10, 0), (0, 0), ellipse(3, 3, 0)))
    found = regions(*mix, np.zeros(2))["course_deg"]
    for level, pieces in found.items():
        # All directions are alike: any set of that share of the circle, or the whole of it.
        assert float(level) / 100.0 - 0.01 <= sum(b - a for a, b in pieces) / 360.0 < 1.0 + 1e-9


def bank_of(mix, steps=3, side=None):
    """The same mixture at every step."""
    weights, means, covs = (np.stack([a] * steps) for a in mix)
    cells = weights.shape[1]
    return Bank(
        weights=weights,
        means=means,
        covs=covs,
        loglik=np.zeros((steps, cells)),
        innovation=np.full((steps, cells, 1), 0.01),
        variance=np.full((steps, cells, 1), 4e-4),
        side=np.zeros(cells) if side is None else np.asarray(side, dtype=float),
    )


def contact_of(steps=3):
    blank = np.full(steps, np.nan)
    return Contact(
        name="a",
        time_s=np.arange(float(steps)),
        bearing_rad=np.zeros(steps),
        cone_rad=blank,
        sigma_rad=np.full(steps, 0.01),
        position_m=np.tile(HERE, (steps, 1)),
        velocity_mps=np.zeros((steps, 2)),
        axis_rad=blank,
    )


def test_own_ship_hears_from_where_it_was_at_that_step():
    moved = HERE + np.array([[0.0, 0.0], [500.0, -300.0], [-100.0, 900.0]])
    contact = replace(contact_of(), position_m=moved)
    for step in (0, 1, 2):
        said = describe(bank_of(FAR), contact, step, observable=True)
        assert said.range_m.estimate == pytest.approx(polar_moments(*FAR, moved[step])[0][0])
        assert said.range_m.regions == regions(*FAR, moved[step])["range_m"]


def test_a_range_begins_at_zero():
    on_a_line = mixture((1, HERE, ellipse(100, 1, 0.3), (1, 0), ellipse(1, 1, 0)))
    past = history(bank_of(on_a_line), contact_of())
    assert past["range_low_m"].tolist() == [0.0] * 3
    assert past["range_high_m"] == pytest.approx(np.full(3, 180.0), rel=0.1)


def test_without_observability_there_is_no_estimate_but_of_the_bearing():
    seen = describe(bank_of(SPREAD), contact_of(), observable=True)
    blind = describe(bank_of(SPREAD), contact_of(), observable=False)
    assert blind.bearing_deg == seen.bearing_deg
    for name in ("range_m", "course_deg", "speed_mps"):
        assert getattr(seen, name).estimate is not None
        assert getattr(blind, name) == replace(getattr(seen, name), estimate=None, sd=None)
    assert (blind.sides, blind.decided) == ((), True)


def test_mean_and_covariance_are_those_of_draws():
    """Six standard errors of a million draws; the largest spread is 3 km."""
    answer, drawn = (
        describe(bank_of(SPREAD), contact_of(), observable=True),
        draws(SPREAD, 1_000_000),
    )
    sd = np.sqrt(np.diag(answer.cov))
    assert np.all(np.abs(answer.mean - drawn.mean(axis=0)) < 6e-3 * sd)
    assert answer.cov / np.outer(sd, sd) == pytest.approx(
        np.cov(drawn.T) / np.outer(sd, sd), abs=0.02
    )


def two_sided(port, starboard):
    """A contact on a bearing of 40 degrees to starboard, or on its mirror image."""
    place, flip = np.array([1_000.0, 839.0]), np.array([1.0, -1.0])
    wide, slow = ellipse(100, 10, 0.7), ellipse(1, 1, 0)
    mirrored = ellipse(100, 10, -0.7)
    mix = mixture(
        (port, HERE + flip * place, mirrored, (4, -3), slow),
        (starboard, HERE + place, wide, (4, 3), slow),
    )
    return bank_of(mix, side=[-1.0, 1.0])


def test_an_undecided_cone_keeps_both_sides_and_says_no_bearing():
    answer = describe(two_sided(3.0, 1.0), contact_of(), observable=True)
    assert not answer.decided
    assert [(side.name, side.probability) for side in answer.sides] == [
        ("port", 0.75),
        ("starboard", 0.25),
    ]
    assert answer.bearing_deg.estimate is None
    assert answer.course_deg.estimate is None
    port, starboard = answer.sides
    assert port.bearing_deg.estimate == pytest.approx(360.0 - starboard.bearing_deg.estimate)
    assert answer.range_m.estimate == pytest.approx(port.range_m.estimate)
    (to_starboard, _), (to_port, _) = answer.bearing_deg.regions["90"]
    assert 30.0 < to_starboard < 40.0
    assert 310.0 < to_port < 320.0


def test_a_decided_cone_is_answered_by_its_side():
    answer = describe(two_sided(1.0, 999.0), contact_of(), observable=True)
    assert answer.decided
    assert answer.sides[0].name == "starboard"
    assert answer.bearing_deg == answer.sides[0].bearing_deg
    assert answer.mean == pytest.approx([1_300.0, 639.0, 4.0, 3.0])
    assert not describe(two_sided(1.2, 98.8), contact_of(), observable=True).decided


def test_a_side_without_weight_is_not_told():
    answer = describe(two_sided(0.0, 1.0), contact_of(), observable=False)
    assert [side.name for side in answer.sides] == ["starboard"]
    assert answer.sides[0].range_m.estimate is None


def test_history_ends_with_the_answer():
    past, answer = (
        history(bank_of(SPREAD), contact_of()),
        describe(bank_of(SPREAD), contact_of(), observable=True),
    )
    for name in NAMES:
        stem, unit = name.rsplit("_", 1)
        assert past[name][-1] == pytest.approx(getattr(answer, name).estimate)
        assert past[f"{stem}_sd_{unit}"][-1] == pytest.approx(getattr(answer, name).sd)
    assert [past["north_m"][-1], past["east_m"][-1]] == pytest.approx(answer.mean[:2].tolist())
    pieces = answer.range_m.regions["90"]
    assert past["range_low_m"][-1] == pytest.approx(pieces[0][0], rel=0.01)
    assert past["range_high_m"][-1] == pytest.approx(pieces[-1][1], rel=0.01)


def test_history_tells_how_each_bearing_was_foreseen():
    """Two cells, weights from the step before: mean 0.02, variance 1e-4 (0.25 . 0.75 . 16 + 4)."""
    bank = two_sided(3.0, 1.0)
    innovation = np.stack([[[0.01], [0.05]]] * 3)
    weights = np.array([[0.75, 0.25], [0.5, 0.5], [0.5, 0.5]])
    variance = bank.variance.copy()
    variance[2] = np.nan
    bank = replace(
        bank, innovation=innovation, weights=weights, variance=variance, side=np.zeros(2)
    )
    past = history(bank, contact_of())
    assert past["innovation_deg"][1] == pytest.approx(np.degrees(0.02))
    assert past["innovation_sd_deg"][1] == pytest.approx(np.degrees(np.sqrt(7e-4)))
    assert past["nis"][1] == pytest.approx(4e-4 / 7e-4)
    assert np.isnan(past["nis"][2])
    assert np.all(past["side_probability"] == 1.0)


def test_history_of_a_cone_is_of_the_side_that_is_the_heavier_at_the_end():
    bank = replace(two_sided(1.0, 3.0), weights=np.array([[0.9, 0.1], [0.5, 0.5], [0.25, 0.75]]))
    past = history(bank, contact_of())
    assert past["side_probability"].tolist() == [0.1, 0.5, 0.75]
    assert past["east_m"] == pytest.approx(np.full(3, 639.0))
    assert past["bearing_sd_deg"].max() < 5.0


def test_a_gaussian_is_a_mixture_of_one():
    start = Gaussian(FAR[1][0], FAR[2][0])
    found = polar_moments(np.ones(1), start.mean[None], start.cov[None], HERE)
    assert np.array_equal(found, polar_moments(*FAR, HERE))

"""OSPA and GOSPA against Stone Soup, every pairing tried, and the axioms of a metric."""

import datetime as dt
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stonesoup.measures import Euclidean
from stonesoup.metricgenerator.ospametric import GOSPAMetric, OSPAMetric
from stonesoup.types.state import State

import boresight as bs
from boresight.errors import UsageError

CASES = 1000
NOW = dt.datetime(2000, 1, 1, tzinfo=dt.UTC)


def random_case(generator):
    """Two sets of 0 to 6 points in 1 to 3 dimensions, one in seven empty; a cutoff and an order."""
    d, (n, m) = generator.integers(1, 4), generator.integers(0, 7, size=2)
    truth, found = 100.0 * generator.standard_normal((n, d)), 100.0 * generator.random((m, d))
    return truth, found, float(generator.choice([20.0, 75.0, 300.0])), generator.choice([1, 2, 3])


def states(points):
    return [State(point[:, None], timestamp=NOW) for point in points]


def stone_soup_ospa(truth, found, c, p):
    """Its OSPA of order 1 in powers of distances, and its own of order p.

    The latter (version 1.9) pairs for the least sum of distances whatever the order is, so for
    orders above 1 its pairing is not always the best: it may then be larger than the metric.
    """
    sets = states(found), states(truth)
    distance = Euclidean()
    powers = OSPAMetric(c=c**p, p=1, measure=lambda a, b: distance(a, b) ** p)
    best = powers.compute_OSPA_distance(*sets).value ** (1 / p)
    return best, OSPAMetric(c=c, p=p).compute_OSPA_distance(*sets).value


def test_equal_to_stone_soup():
    generator = np.random.default_rng(1)
    empty = 0
    for _ in range(CASES):
        truth, found, c, p = random_case(generator)
        empty += 0 in (len(truth), len(found))
        ours, general = (f(truth, found, cutoff_m=c, order=p) for f in (bs.ospa, bs.gospa))
        if not len(truth) and not len(found):  # two empty sets have no time in Stone Soup
            assert ours.distance == general.distance == 0.0
            continue
        best, own = stone_soup_ospa(truth, found, c, p)
        assert abs(ours.distance - best) < 1e-9
        assert abs(ours.distance - own) < 1e-9 or (p > 1 and ours.distance < own)
        metric, _ = GOSPAMetric(c=c, p=p).compute_gospa_metric(states(found), states(truth))
        assert abs(general.distance - metric.value["distance"]) < 1e-9
        for part in ("localisation", "missed", "false"):
            assert abs(getattr(general, part) - float(metric.value[part]) ** (1 / p)) < 1e-9
    assert empty > 200


def by_trial(truth, found, c, p, alpha=None):
    """The least cost over all pairings; OSPA's where there is no alpha."""
    few, many = sorted((truth, found), key=len)
    surplus = len(many) - len(few)
    costs = [
        sum(min(np.linalg.norm(a - many[i]), c) ** p for a, i in zip(few, order, strict=False))
        for order in permutations(range(len(many)), len(few))
    ]
    if alpha is None:
        return ((min(costs) + surplus * c**p) / max(len(many), 1)) ** (1 / p)
    return (min(costs) + surplus * c**p / alpha) ** (1 / p)


def test_no_pairing_is_better():
    generator = np.random.default_rng(2)
    for _ in range(60):
        truth, found, c, p = random_case(generator)
        truth, found = truth[:4], found[:4]
        ours = bs.ospa(truth, found, cutoff_m=c, order=p).distance
        assert ours == pytest.approx(by_trial(truth, found, c, p))
        for alpha in (0.5, 1.0, 2.0):
            ours = bs.gospa(truth, found, cutoff_m=c, order=p, alpha=alpha).distance
            assert ours == pytest.approx(by_trial(truth, found, c, p, alpha))


POINTS = st.lists(st.tuples(*[st.floats(-100, 100)] * 2), max_size=4)
ORDERS = st.sampled_from([1.0, 1.5, 2.0, 4.0])
MEASURES = [
    lambda a, b, p: bs.ospa(a, b, cutoff_m=50.0, order=p).distance,
    lambda a, b, p: bs.gospa(a, b, cutoff_m=50.0, order=p).distance,
    lambda a, b, p: bs.gospa(a, b, cutoff_m=50.0, order=p, alpha=1.0).distance,
]


@pytest.mark.parametrize("measure", MEASURES)
@given(a=POINTS, b=POINTS, c=POINTS, p=ORDERS)
def test_they_are_metrics(measure, a, b, c, p):
    assert measure(a, a, p) == 0.0
    assert measure(a, b, p) == pytest.approx(measure(b, a, p), abs=1e-9)
    assert measure(a, b, p) > 0.0 or np.allclose(sorted(a), sorted(b), atol=1e-9)
    assert measure(a, c, p) <= measure(a, b, p) + measure(b, c, p) + 1e-9


@given(a=POINTS, b=POINTS, p=ORDERS)
def test_parts_add_up(a, b, p):
    flat = bs.ospa(a, b, cutoff_m=50.0, order=p)
    assert flat.distance**p == pytest.approx(flat.localisation**p + flat.cardinality**p)
    full = bs.gospa(a, b, cutoff_m=50.0, order=p)
    assert full.distance**p == pytest.approx(full.localisation**p + full.missed**p + full.false**p)
    assert full.pairs + full.missed_count == len(a)
    assert full.pairs + full.false_count == len(b)
    assert full.missed**p == pytest.approx(full.missed_count * 50.0**p / 2)


def test_a_pair_beyond_the_cutoff_is_one_missed_and_one_false():
    found = bs.gospa([[0.0, 0.0], [10.0, 0.0]], [[0.0, 3.0], [500.0, 0.0]], cutoff_m=20.0)
    assert (found.pairs, found.missed_count, found.false_count) == (1, 1, 1)
    assert found.localisation == pytest.approx(3.0)
    assert found.distance == pytest.approx(np.sqrt(9.0 + 400.0))


def test_sequences_of_sets():
    """Three scans: both there, the estimate missing (NaN), two estimates of nothing."""
    truth = [[[0.0, 0.0]], [[0.0, 0.0]], np.empty((0, 2))]
    found = [[[3.0, 4.0]], [[np.nan, 0.0]], [[0.0, 0.0], [1.0, 1.0]]]
    flat = bs.ospa(truth, found, cutoff_m=10.0)
    assert flat.distance == pytest.approx([5.0, 10.0, 10.0])
    assert flat.localisation == pytest.approx([5.0, 0.0, 0.0])
    full = bs.gospa(truth, found, cutoff_m=10.0)
    assert full.distance == pytest.approx([5.0, np.sqrt(50.0), 10.0])
    assert full.missed_count.tolist() == [0, 1, 0]
    assert full.false_count.tolist() == [0, 0, 2]
    runs = bs.gospa(np.zeros((5, 3, 1, 2)), np.zeros((3, 2, 2)), cutoff_m=10.0)
    assert runs.distance.shape == (5, 3)
    assert np.all(runs.false_count == 1)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((np.zeros((1, 2)), np.zeros((1, 3))), "cannot be compared"),
        ((np.zeros((2, 1, 2)), np.zeros((3, 1, 2))), "cannot be compared"),
        (([1.0, 2.0], np.zeros((1, 2))), "not a set of points"),
        (([[[1.0, 2.0]], [[1.0]]], np.zeros((1, 2))), "not a list of sets"),
    ],
)
def test_what_is_no_set_is_refused(arguments, word):
    with pytest.raises(UsageError, match=word):
        bs.ospa(*arguments, cutoff_m=1.0)


@pytest.mark.parametrize("wrong", [{"cutoff_m": 0.0}, {"order": 0.5}, {"alpha": 3.0}])
def test_numbers_out_of_range_are_refused(wrong):
    with pytest.raises(UsageError, match=next(iter(wrong))):
        bs.gospa(np.zeros((1, 2)), np.zeros((1, 2)), **{"cutoff_m": 1.0} | wrong)

"""Studies of filters that are consistent, or are not: how often the bands say so.

A null study's filter is consistent, so bands of 99 % reject 1 % of them. Of 1,000 independent
studies at that rate fewer than 3 or more than 20 are rejected in 3 of 1,000 trials; the seeds are
fixed.
"""

from dataclasses import replace

import numpy as np
import pytest
from worlds_of_study import LINEAR, MILD, believing, contender, gathered, study_of, world

from boresight.experiments.metrics import chi_square_bounds
from boresight.laboratory.intervals import anees_band
from boresight.laboratory.summary import summarise

STUDIES = 1000
FEWEST, MOST = 0.003 * STUDIES, 0.02 * STUDIES
NULLS = [("kf", LINEAR), ("mekf", MILD)]
TESTS = ("nees", "nis")


def outside(value, bounds):
    return not bounds[0] <= value <= bounds[1]


def rejections(runs_each, name, sensor, believed):
    """Of 1,000 studies of so many runs, cut from one long one: what each band rejects."""
    study = study_of(
        world(sensor), contender(name, believed), runs=STUDIES * runs_each, seed=runs_each
    )
    runs = {key: each.reshape(STUDIES, -1) for key, each in gathered(study)[0].runs.items()}
    nees = [outside(np.mean(row), anees_band(row, 4, 0.01)) for row in runs["nees"]]
    nis, dof = np.sum(runs["nis"], axis=1), np.sum(runs["dof"], axis=1)
    anis = [outside(a / b, chi_square_bounds(b, 0.01)) for a, b in zip(nis, dof, strict=True)]
    return {"nees": np.sum(nees), "nis": np.sum(anis)}


@pytest.mark.parametrize("runs_each", [20, 100])
@pytest.mark.parametrize(("name", "sensor"), NULLS)
def test_consistent_filters_are_rejected_as_often_as_stated(name, sensor, runs_each):
    found = rejections(runs_each, name, sensor, sensor)
    for each in TESTS:
        assert FEWEST <= found[each] <= MOST, found


@pytest.mark.parametrize(("name", "sensor"), NULLS)
def test_variances_believed_too_large_are_caught(name, sensor):
    """Both bands in studies of 200 runs. Of 100 runs NEES catch 95 %; NIS, independent, all."""
    found = rejections(200, name, sensor, believing(sensor, 1.3))
    for each in TESTS:
        assert found[each] >= 0.99 * STUDIES, found


@pytest.mark.slow
@pytest.mark.parametrize(("name", "sensor"), NULLS)
def test_whole_studies_of_their_own_seeds(name, sensor):
    """The same from the summary of 1,000 studies, each with a seed of its own."""
    caught = {"anees": 0, "anis": 0}
    for seed in range(STUDIES):
        study = study_of(world(sensor), contender(name, sensor), seed=seed, metrics=("rmse",))
        cell = summarise(study, gathered(study)).cells[0]
        caught["anees"] += outside(cell.anees.value, cell.anees_bounds)
        caught["anis"] += outside(cell.anis, cell.anis_bounds)
    assert all(FEWEST <= count <= MOST for count in caught.values()), caught


def test_a_filter_does_not_win_against_itself():
    for seed in range(200):
        own = [contender("mekf", MILD, label) for label in ("mekf", "the same")]
        study = study_of(world(MILD, scans=10), *own, runs=20, seed=seed, metrics=("rmse",))
        (found,) = summarise(study, gathered(study)).comparisons
        assert not found.is_win
        assert found.ratio == (1.0, 1.0, 1.0)


def test_equal_filters_seldom_win():
    """Two filters of the same law of errors, on runs of their own: wins by chance.

    200 studies of 50 runs, intervals of 99 %: 8 or more wins have a chance of 1 in 1,000.
    """
    wins = 0
    both = [contender("kf", LINEAR, label) for label in ("one", "two")]
    study = study_of(world(LINEAR), *both, runs=50, metrics=("rmse",))
    for seed in range(200):
        (all_of_it, _) = gathered(replace(study, runs=100, seed=seed))
        halves = [
            replace(all_of_it, count=50, runs={n: x[part] for n, x in all_of_it.runs.items()})
            for part in (slice(50), slice(50, 100))
        ]
        (found,) = summarise(study, halves).comparisons
        wins += found.is_win
    assert wins < 8

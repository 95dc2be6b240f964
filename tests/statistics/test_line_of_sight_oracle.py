"""Filters against the exact posterior in the dynamic scenario.

Ratios and ANEES are those of the drawn runs; the `expected` ones, over all truths that the plots
allow, take the truth's own chance out of them. Thresholds hold for both. `pytest -s` prints the
tables.
"""

import sys

import numpy as np
import polars as pl
import pytest

from boresight import catalogue
from boresight.experiments.against_posterior import EXACT, against_posterior
from boresight.experiments.metrics import chi_square_bounds
from boresight.experiments.posterior import Flight
from boresight.models.sensors import Radar

pytestmark = pytest.mark.slow

SCANS = (9, 19, 49, 99)
RUNS = 2000
ANGLES_DEG = (5.0, 10.0, 15.0)
FIVE, THREE, ONE = "5 components", "3 components", "1 component"
OTHERS = ("ducm", "ckf", "iplf")


def filters():
    sight = catalogue.lookup("line-of-sight")
    ours = {f"{k} component{'s' * (k > 1)}": sight.with_settings(components=k) for k in (5, 3, 1)}
    return ours | {name: catalogue.lookup(name) for name in OTHERS}


def dynamic(azimuth_deg):
    sensor = Radar(range_m=100.0, azimuth_deg=azimuth_deg)
    return Flight(sensor=sensor, range_m=1e4 * np.sqrt(2), speed_mps=30.0, scans=100)


@pytest.fixture(scope="module", params=ANGLES_DEG, ids=lambda deg: f"{deg:g}deg")
def table(request):
    found = against_posterior(dynamic(request.param), filters(), at=SCANS, runs=RUNS, seed=14)
    with pl.Config(tbl_rows=-1, tbl_cols=-1, tbl_width_chars=400, float_precision=4):
        sys.stdout.write(f"\n{request.param:g} degrees\n{found}\n")
    return found


def rows(table, name):
    found = table.filter(pl.col("filter") == name)
    assert len(found) == len(SCANS)
    return found


def test_the_yardstick_is_sound(table):
    exact = rows(table, EXACT)
    assert exact["least_ess"].min() > 1000
    # NEES of a bent posterior spreads up to 1.4 times as much as chi-square: a band of 3.9 of its
    # standard deviations is 2.8 of ours, passed by chance once in 200 at one scan of one angle.
    low, high = chi_square_bounds(4 * RUNS, 1e-4)
    assert exact["anees"].is_between(low, high).all()


@pytest.mark.parametrize(("name", "worst"), [(FIVE, 1.02), (THREE, 1.04)])
@pytest.mark.parametrize("of", ["position", "velocity"])
def test_mixtures_are_at_the_best_possible(table, name, worst, of):
    found = rows(table, name)
    assert found[f"{of}_ratio"].max() <= worst
    assert found[f"{of}_expected"].max() <= worst


def test_five_components_know_their_errors(table):
    """The ANEES of drawn truths has a standard error of 0.018, the expected one of 0.002.

    Most of the former is the truths' own chance, in which the exact posterior shares: a draw that
    has 1.06 of it there has it here too. What ours has more is 0.004 at most.
    """
    found = rows(table, FIVE)
    assert found["expected_nees"].is_between(0.88, 1.05).all()
    more = found["anees"] - rows(table, EXACT)["anees"]
    assert more.is_between(-0.12, 0.05).all()


@pytest.mark.parametrize("name", OTHERS)
def test_others_are_worse_in_the_end_by_more_than_chance(request, table, name):
    """The paired 99 % interval at scan 100 lies above 1 for the others.

    In velocity everywhere; in position too, but for the posterior linearisation at 5 degrees: it
    is 1.5 % worse there, and 2,000 runs cannot tell that from chance.
    """
    last = rows(table, name).row(-1, named=True)
    assert last["velocity_low"] > 1
    if (name, request.node.callspec.params["table"]) == ("iplf", 5.0):
        assert last["position_expected"] > 1.005
    else:
        assert last["position_low"] > 1


@pytest.mark.parametrize(
    "flight",
    [
        dynamic(2.5),
        Flight(
            sensor=Radar(range_m=50.0, azimuth_deg=0.3),
            range_m=100_000.0,
            speed_mps=150.0,
            dt_s=4.0,
            scans=100,
        ),
    ],
    ids=["2.5deg", "100km"],
)
def test_nothing_is_lost_where_conversion_is_enough(flight):
    compared = {name: each for name, each in filters().items() if name in (FIVE, THREE, "ducm")}
    found = against_posterior(flight, compared, at=SCANS, runs=RUNS, seed=15)
    ducm = rows(found, "ducm")
    for name in (FIVE, THREE):
        for of in ("position", "velocity"):
            # In the expectation no chance is left: no worse is no worse to three digits.
            assert (rows(found, name)[f"{of}_expected"] <= ducm[f"{of}_expected"] + 1e-3).all()

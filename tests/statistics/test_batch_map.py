"""The batch estimate over the Cramér-Rao bound with the same prior, in the paper's scenario."""

import numpy as np
import pytest

from boresight.filters import batch, fisher
from mixtures import heard
from oracles import pradeep as paper

RUNS = 3_000
OWN, RELATIVE = heard.OWN, heard.RELATIVE
PRIOR = batch.velocity_prior(heard.straight(), 11.0)


def fitted(at, seed=20):
    """Estimates of all runs after `at` seconds, and the truth there."""
    steps = at + 1
    z = paper.measured(RELATIVE[:steps], RUNS, seed)
    own = OWN[:steps, ::-1]
    along = np.stack([np.cos(z[:, -1]), np.sin(z[:, -1])], axis=-1)[:, None]
    spots = own[-1] + np.array([2_000.0, 5_000.0, 12_000.0])[:, None] * along
    starts = np.concatenate([spots, np.zeros_like(spots)], axis=-1)
    sensor, dt = heard.bearings_from(OWN[:steps]), heard.every_second(steps)
    found = batch.batch_map(z[..., None], heard.straight(), sensor, dt, prior=PRIOR, starts=starts)
    speed = paper.TARGET * paper.heading(paper.COURSE)[::-1]
    truth = np.column_stack([paper.target(paper.TARGET)[:steps, ::-1], np.tile(speed, (steps, 1))])
    ears = np.ones((1, steps, 1))
    information = fisher.fisher_information(
        truth[None], heard.straight(), sensor, dt, ears, prior=PRIOR.information
    )
    return found, truth[-1], fisher.bound(information[0, -1])


@pytest.mark.slow
@pytest.mark.parametrize("at", [240, 400, 800])
def test_reaches_the_bound(at):
    # One direction makes nearly all of the error, so 3,000 runs give the ratio to 1.3 %; the
    # limits are at least three of that away from what was found over 45,000 (1.00, 0.99, 1.00).
    found, truth, cov = fitted(at)
    error = found.mean - truth
    ratio = np.sqrt(np.mean(np.sum(error[:, :2] ** 2, axis=1)) / (cov[0, 0] + cov[1, 1]))
    assert found.converged.all()
    assert 0.93 < ratio < 1.05


@pytest.mark.slow
@pytest.mark.parametrize("at", [240, 400, 800])
def test_its_own_covariance_is_honest(at):
    # Mean of 12,000 squared normals over 4: standard deviation 0.013; four of them.
    found, truth, _ = fitted(at, seed=21)
    error = found.mean - truth
    squares = np.einsum("ri,rij,rj->r", error, found.information, error)
    assert abs(squares.mean() / 4.0 - 1.0) < 0.052

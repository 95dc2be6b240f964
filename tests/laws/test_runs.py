"""Many lanes are one lane many times: batch, loop and stream agree to the bit; failures stay."""

import numpy as np
import pytest

from boresight.errors import Status, UsageError
from boresight.filters.recursion import OUTPUTS, run_recursion
from boresight.filters.stream import Stream
from boresight.maths import Gaussian
from boresight.testing import lanes
from boresight.testing.lanes import LANES, STEPS, recorded
from laws.enrolled import BEARING_WORLDS, BY_EAR, FILTERS, LINEAR_WORLDS, POLAR_WORLDS

PAIRS = [
    pytest.param(entry, world, id=f"{entry}-{world}")
    for entries, worlds in (
        ([e for e in FILTERS if not e.curved], LINEAR_WORLDS[:1]),
        ([e for e in FILTERS if e.curved], (LINEAR_WORLDS[0], POLAR_WORLDS[0])),
        (BY_EAR, BEARING_WORLDS),
    )
    for entry in entries
    for world in worlds
]
everyone = pytest.mark.parametrize(("entry", "world"), PAIRS)


def part_of(start, lane):
    return Gaussian(start.mean[lane : lane + 1], start.cov[lane : lane + 1])


@everyone
def test_a_batch_is_its_lanes_and_a_run_is_its_steps_bit_for_bit(entry, world):
    lanes.batch(entry.on(world), world)


@everyone
def test_a_stream_is_the_batch_bit_for_bit(entry, world):
    lanes.stream(entry.on(world), world, rtol=0.0)


@everyone
def test_the_batch_is_the_formula_on_floats(entry, world):
    lanes.formula(entry.on(world), world)


@everyone
def test_inputs_are_left_alone(entry, world):
    start, z = recorded(world)
    copies = [a.copy() for a in (start.mean, start.cov, z)]
    first = run_recursion(entry.recursion(world), z, 2.0, start)
    kept = first.final.data.copy()
    run_recursion(entry.recursion(world), z, 2.0, first.final, threads=2)
    for array, copy in zip(
        (start.mean, start.cov, z, first.final.data), (*copies, kept), strict=True
    ):
        np.testing.assert_array_equal(array, copy)


FAULTS = {
    "mean not a number": (np.nan, None, Status.NOT_FINITE),
    "mean infinite": (np.inf, None, Status.NOT_FINITE),
    "variance not a number": (None, np.nan, Status.NOT_FINITE),
    "variance infinite": (None, np.inf, Status.NOT_FINITE),
    "variance negative": (None, -1e9, Status.NOT_POSITIVE),
}


@everyone
@pytest.mark.parametrize("fault", FAULTS)
def test_a_lane_that_fails_says_so_and_leaves_its_neighbours_bits_alone(entry, world, fault):
    start, z = recorded(world)
    recursion = entry.recursion(world)
    z = np.full_like(z, np.nan)  # no plot: the state shows what it became by itself
    healthy = run_recursion(recursion, z, 2.0, start, outputs=OUTPUTS)
    in_mean, in_cov, status = FAULTS[fault]
    mean, cov = start.mean.copy(), start.cov.copy()
    if in_mean is not None:
        mean[2, 0] = in_mean
    else:
        cov[2, -1, -1] = in_cov
    sick = run_recursion(recursion, z, 2.0, Gaussian(mean, cov), outputs=OUTPUTS)
    others = [lane for lane in range(LANES) if lane != 2]
    # Where points are taken of it, they are not numbers.
    told = {status, Status.NOT_FINITE} if entry.own_state else {status}
    assert set(sick.status[2]) <= told
    assert (healthy.status == Status.OK).all()
    for name in OUTPUTS:
        np.testing.assert_array_equal(sick.others[name][others], healthy.others[name][others])


def test_a_correlation_beyond_one_is_not_positive_definite_although_its_diagonal_is():
    world = LINEAR_WORLDS[0]
    start, z = recorded(world)
    cov = np.tile(np.diag([100.0, 100, 100, 9, 9, 9]), (LANES, 1, 1))
    cov[1, 0, 1] = cov[1, 1, 0] = 150.0
    got = run_recursion(
        FILTERS[0].recursion(world), np.full_like(z, np.nan), 0.0, Gaussian(start.mean, cov),
        outputs=["status"],
    )  # fmt: skip
    assert got.status[:, -1].tolist() == [0, Status.NOT_POSITIVE, 0, 0, 0]


def test_what_does_not_fit_is_refused_before_it_is_read():
    """A compiled kernel reads memory by address: sizes that do not fit must never reach it."""
    world = POLAR_WORLDS[0]
    start, z = recorded(world)
    recursion = FILTERS[1].recursion(world)
    small = Gaussian(start.mean[:, :4], start.cov[:, :4, :4])
    wrong = [
        lambda: run_recursion(recursion, z[:, :0], 2.0, start),
        lambda: run_recursion(recursion, z[..., :2], 2.0, start),
        lambda: run_recursion(recursion, z, 2.0, small),
        lambda: run_recursion(recursion, z, 2.0, Gaussian(start.mean[:3], start.cov[:3])),
        lambda: run_recursion(recursion, z, 2.0, Gaussian(start.mean, start.cov[..., :4])),
        lambda: run_recursion(recursion, z, np.ones(3), start),
        lambda: run_recursion(recursion, z, np.ones((LANES, STEPS + 1)), start),
        lambda: run_recursion(recursion, z, np.ones((1, STEPS, 1)), start),
        lambda: run_recursion(recursion, z, 2.0, start, threads=0),
        lambda: run_recursion(recursion, z, 2.0, start, outputs=["meen"]),
        lambda: Stream(recursion).start(Gaussian(start.mean[0, :4], start.cov[0, :4, :4])),
        lambda: Stream(recursion, 3).start(start),
        lambda: Stream(recursion)(Stream(recursion, 9).start(part_of(start, 0)), z[0, 0], 2.0),
        lambda: Stream(recursion)(Stream(recursion).start(part_of(start, 0)), z[0, 0], -1.0),
        lambda: Stream(recursion)(Stream(recursion).start(part_of(start, 0)), z[0], 1.0),
    ]
    for call in wrong:
        with pytest.raises(UsageError):
            call()


def test_no_lanes_is_an_empty_answer():
    world = POLAR_WORLDS[0]
    start, z = recorded(world)
    none = run_recursion(
        FILTERS[1].recursion(world), z[:0], 2.0, Gaussian(start.mean[:0], start.cov[:0])
    )
    assert none.mean.shape == (0, STEPS, 6)


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("mekf", {"mu": "printd"}),
        ("mekf", {"mu": True}),
        ("mekf-block", {"mu": "none"}),
        ("iekf", {"iterations": 0}),
        ("ekf", {"iterations": 2}),
        ("kf", {}),
    ],
)
def test_a_setting_or_sensor_that_means_nothing_is_refused(name, settings):
    from boresight import catalogue

    world = POLAR_WORLDS[0]
    start, z = recorded(world)
    with pytest.raises(UsageError):
        run_recursion(
            catalogue.lookup(name).with_settings(**settings).recursion(world.motion, world.sensor),
            z, 2.0, start,
        )  # fmt: skip

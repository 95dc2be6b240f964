"""Laws that every filter keeps, to hold your own filter to, in your own test-suite.

For example::

    import boresight as bs
    import pytest

    @pytest.mark.parametrize("law", bs.testing.laws(), ids=str)
    def test_my_filter_keeps(law):
        law(MY_FILTER)

    def test_my_filter_knows_its_errors():
        truth, plots = bs.simulate("kashyap-set-2", RADAR, runs=500, seed=1)
        estimate = bs.run(MY_FILTER, MOTION, RADAR, plots, outputs=("mean", "cov", "nis", "dof"))
        bs.testing.assert_consistent(estimate, truth)

A law that is broken says which one, in which world, by how much, and how to repeat it. Filters that
are not made for a world refuse it by a `UsageError`, and are not judged there. Some are right to
break one: a filter whose sigma points lie along the axes keeps `half turn` and not `rotation`, one
that keeps a curved state is not `kalman`. Say so: `check(MY_FILTER, without=("rotation",))`.
"""

from collections.abc import Sequence
from typing import NamedTuple

from boresight.errors import UsageError
from boresight.filters.method import FilterLike, Outside
from boresight.testing.comparing import BrokenLawError
from boresight.testing.consistent import assert_consistent
from boresight.testing.laws import Law, law_of, laws, refusal, world_of
from boresight.testing.subjects import subject_of
from boresight.testing.worlds import WORLDS, World

__all__ = ["BrokenLawError", "Checked", "Law", "World", "assert_consistent", "check", "laws"]


class Checked(NamedTuple):
    """What a filter was held to.

    Attributes:
        laws: names of those that it keeps.
        worlds: names of those it was judged in.
        refused: by the name of a world, why the filter cannot be used there.
    """

    laws: tuple[str, ...]
    worlds: tuple[str, ...]
    refused: dict[str, str]


def check(
    filter: FilterLike | Outside,  # noqa: A002 - the field's word
    *,
    law: str | None = None,
    world: str | World | None = None,
    seed: int | None = None,
    without: Sequence[str] = (),
) -> Checked:
    """Hold a filter to the laws.

    Args:
        filter: a name, a `Filter`, an `Outside`, or an update formula.
        law: only this one.
        world: only this one: a name, or a `World(motion, sensor)` of your own, in which the laws
            that are not about worlds of a kind are tried.
        seed: only this case.
        without: names of laws that it is right to break.

    Returns:
        What was tried; the laws are kept.

    Raises:
        BrokenLawError: an AssertionError: the law, the world, the largest difference, and the call
            that repeats it.
        UsageError: no such law or world, or the filter takes none of the worlds.
    """
    subject = subject_of(filter)
    passed_over = {law_of(name).name for name in without}
    own = world_of(world) if isinstance(world, str) else world
    kept, judged = [], []
    for each in laws() if law is None else (law_of(law),):
        if each.name not in passed_over:
            where = each.worlds if own is None else [own] if fits(each, own) else []
            found = each(subject.filter, worlds=where, seed=seed)
            kept += [each.name] if found else []
            judged += [str(one) for one in found]
    asked = WORLDS if own is None else (own,)
    refused = {str(one): reason for one in asked if (reason := refusal(subject, one))}
    if not kept:
        raise UsageError(
            f"{subject.filter.name} was held to no law",
            why="; ".join(f"{name}: {reason}" for name, reason in refused.items()),
            next_step="give a world that it takes: world=World(motion, sensor)",
        )
    return Checked(tuple(kept), tuple(dict.fromkeys(judged)), refused)


def fits(law: Law, world: World) -> bool:
    """Whether a law can be tried in a world: one of its own, or any, if it is not about a kind."""
    return world in law.worlds or (world not in WORLDS and law.worlds == WORLDS)

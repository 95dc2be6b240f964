"""The laws by name, and the worlds in which each must hold."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from boresight.errors import BoresightError, UsageError, unknown
from boresight.filters.method import FilterLike, Outside
from boresight.testing import lanes, symmetries
from boresight.testing.comparing import BrokenLawError
from boresight.testing.subjects import Stepping, Whole, subject_of
from boresight.testing.worlds import CURVED, LINEAR, POSED, UPRIGHT, WORLDS, World

SEEDS = 6  # cases of a law in a world, where a case costs a millisecond


@dataclass(frozen=True, kw_only=True)
class Law:
    """What every filter keeps. Call it with a filter: it raises AssertionError if it is broken.

    Attributes:
        name: what `check` and messages call it.
        says: the law as a sentence.
        holds: (subject, world, seed), raises if it does not.
        worlds: where it is tried.
        cases: how many seeds are tried.
        of_steps: whether it is about the steps that a function over whole recordings has not.
    """

    name: str
    says: str
    holds: Callable[..., None]
    worlds: tuple[World, ...] = WORLDS
    cases: int = SEEDS
    of_steps: bool = False

    def __str__(self) -> str:
        return self.name

    def __call__(
        self,
        filter: FilterLike | Outside,  # noqa: A002 - the field's word
        *,
        worlds: Sequence[World] | None = None,
        seed: int | None = None,
    ) -> tuple[World, ...]:
        """Hold a filter to the law.

        Args:
            filter: a name, a filter or an update formula.
            worlds: where; left out, the law's own.
            seed: of the one case to try; left out, a few.

        Returns:
            The worlds in which the filter was judged: it may refuse one by a `UsageError`.

        Raises:
            BrokenLawError: an AssertionError that says what differs, where, and how to repeat it.
        """
        subject = subject_of(filter)
        if self.of_steps and isinstance(subject, Whole):
            return ()
        found = tuple(
            world
            for world in (self.worlds if worlds is None else worlds)
            if refusal(subject, world) is None
        )
        for world in found:
            for case in range(self.cases) if seed is None else (seed,):
                self._try(subject, world, case)
        return found

    def _try(self, subject: Stepping | Whole, world: World, seed: int) -> None:
        repeat = f'boresight.testing.check(FILTER, law="{self.name}", world="{world}", seed={seed})'
        try:
            self.holds(subject, world, seed)
        except Exception as error:  # noqa: BLE001 - whatever a user's formula raises is a finding
            kind = "" if isinstance(error, BrokenLawError) else f"{type(error).__name__}: "
            cause = None if isinstance(error, BrokenLawError) else error
            raise BrokenLawError(
                f"{subject.filter.name} breaks the law {self.name!r}: {self.says}.\n"
                f"  found:   {kind}{error}\n  where:   {world}, seed {seed}\n  repeat:  {repeat}"
            ) from cause


def refusal(subject: Stepping | Whole, world: World) -> str | None:
    """Why a filter cannot be used in a world, in its own words; None if it can."""
    mean, cov, z = world.case(0)
    try:
        if isinstance(subject, Stepping):
            subject.update(world, mean, cov, z)
    except UsageError as error:
        return error.what
    except BoresightError:
        raise
    except Exception:  # noqa: BLE001 - a fault is the laws' to find
        return None
    return None


LAWS = (
    Law(
        name="kalman",
        says="in a linear world it is the Kalman filter",
        holds=symmetries.kalman,
        worlds=LINEAR,
    ),
    Law(
        name="order",
        says="in a linear world the order of components is irrelevant",
        holds=symmetries.order,
        worlds=LINEAR,
    ),
    Law(
        name="missing plot",
        says="a plot without any component changes nothing",
        holds=symmetries.missing_plot,
    ),
    Law(
        name="missing component",
        says="a component that is NaN is one that the sensor does not have",
        holds=symmetries.missing_component,
        worlds=CURVED,
    ),
    Law(
        name="whole turn",
        says="a whole turn of an angle changes nothing",
        holds=symmetries.whole_turn,
        worlds=CURVED,
    ),
    Law(
        name="half turn",
        says="half a turn of the world turns the answer",
        holds=symmetries.half_turn,
        worlds=UPRIGHT,
    ),
    Law(
        name="rotation",
        says="any turn of the world about the vertical turns the answer",
        holds=symmetries.rotation,
        worlds=UPRIGHT,
    ),
    Law(
        name="elsewhere",
        says="moving the world and its sensor together moves the answer",
        holds=symmetries.elsewhere,
        worlds=POSED,
    ),
    Law(
        name="covariance",
        says="covariances are symmetric and positive definite",
        holds=symmetries.covariance,
    ),
    Law(name="inputs", says="what it is given stays as it is", holds=symmetries.inputs),
    Law(
        name="formula",
        says="machine code over many runs is the formula on floats",
        holds=lanes.formula,
        cases=1,
        of_steps=True,
    ),
    Law(
        name="batch",
        says="a batch is its runs and a run is its steps, bit for bit",
        holds=lanes.batch,
        cases=1,
    ),
    Law(
        name="stream",
        says="live, plot by plot, it is the batch",
        holds=lanes.stream,
        cases=1,
        of_steps=True,
    ),
)


def laws() -> tuple[Law, ...]:
    """Every law, each to be called on a filter; the order is that of the table in the docs."""
    return LAWS


def law_of(name: str) -> Law:
    """The law of that name; UsageError with the nearest valid one if there is none."""
    known = {law.name: law for law in LAWS}
    if name not in known:
        raise unknown("law", name, known)
    return known[name]


def world_of(name: str) -> World:
    """The world of that name; UsageError with the nearest valid one if there is none."""
    known = {world.name: world for world in WORLDS}
    if name not in known:
        raise unknown("world", name, known)
    return known[name]

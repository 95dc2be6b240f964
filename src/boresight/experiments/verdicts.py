"""Verdicts: what may be said of a number or a claim that a paper prints.

    reproduces          a number: inside the band of single runs, and within 5 % of our median;
                        a claim: true in at least 95 % of our runs
    in band             a number: inside the band, but the band is too wide to say more;
                        a claim: true in some runs and false in others
    does not reproduce  a number: outside the band; a claim: true in at most 5 % of our runs, and
                        of so many that 10 % would hardly have been missed
    cannot be checked   what it depends on is not printed

A paper prints one run, or does not say how many; so the band is that of single runs, 5 to 95 %.

A table of many numbers has some outside their bands by chance: how many, our own runs tell. It is
in band unless fewer of its numbers are inside than of 95 % of our runs.

A claim about averages over many runs is judged point by point (scans, bearings): there it holds or
fails by three standard errors, those of paired differences where filters saw the same plots, or
it is undecided. It reproduces if it holds at 95 % of the points or more and fails at none, does not
reproduce if it fails at 95 % or more, and else is in band; so is a claim of several sentences of
which some hold and some do not. Equal averages are told apart once in
370 points.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

Array = Any
Verdict = Literal["reproduces", "in band", "does not reproduce", "cannot be checked"]
_BAND = (0.05, 0.95)
_CLOSE = 0.05
_NO_MORE = 0.10  # of runs: to call a claim false, more must be ruled out
_SIGNIFICANT = 3.0  # standard errors
_RANK: tuple[Verdict, ...] = ("does not reproduce", "cannot be checked", "in band", "reproduces")


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A table, figure or sentence of a paper, beside ours.

    Attributes:
        id: as in the list of all claims, `AD-T3`.
        where: in the paper.
        published: a number, a sentence, or numbers by name.
        ours: the same of our runs.
        band: in which single runs of ours lie, (low, high); by name; or None.
        verdict: see the module.
        assumption: what we had to assume, and how the verdict was found.
        parts: claims that this one is made of.
    """

    id: str
    where: str
    published: Any
    ours: Any
    band: Any = None
    verdict: Verdict
    assumption: str = ""
    parts: tuple["Claim", ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """For JSON; `parts` only where there are some."""
        row = {name: getattr(self, name) for name in _FIELDS}
        return row | ({"parts": [part.as_dict() for part in self.parts]} if self.parts else {})


def part(
    whole: str,
    name: str,
    published: Any,
    ours: Any,
    verdict: Verdict,
    why: str = "",
    band: Any = None,
) -> Claim:
    """One number, one sentence or one misprint of a claim."""
    return Claim(
        id=f"{whole} {name}",
        where="",
        published=published,
        ours=ours,
        band=band,
        verdict=verdict,
        assumption=why,
    )


def said(true: Any) -> Verdict:
    """Verdict on a sentence that holds or does not."""
    return "reproduces" if true else "does not reproduce"


_FIELDS = ("id", "where", "published", "ours", "band", "verdict", "assumption")


def band_of(values: Array) -> tuple[float, float]:
    """5 % and 95 % quantiles of single runs (runs,)."""
    low, high = np.quantile(values, _BAND)
    return float(low), float(high)


def of_number(published: float, values: Array, *, fitted: bool = False) -> Verdict:
    """Verdict on a printed number.

    Args:
        published: the number.
        values: single runs of ours (runs,).
        fitted: whether something not printed was chosen so that numbers fit: then a number that
            does is in the band, and no more is said of it.
    """
    low, high = band_of(values)
    if not low <= published <= high:
        return "does not reproduce"
    near = abs(float(np.median(values)) / published - 1.0) <= _CLOSE
    return "reproduces" if near and not fitted else "in band"


def of_table(published: Mapping[str, float], ours: Mapping[str, Array]) -> tuple[str, Verdict]:
    """How many of a table's numbers are in their bands, which are not, and the verdict."""
    bands = {name: band_of(ours[name]) for name in published}
    inside = {name: low <= published[name] <= high for name, (low, high) in bands.items()}
    each = [(ours[name] >= low) & (ours[name] <= high) for name, (low, high) in bands.items()]
    needed = int(np.quantile(np.sum(each, axis=0), 0.05, method="lower"))
    count, outside = sum(inside.values()), [name for name, true in inside.items() if not true]
    words = f"{count} of {len(inside)} numbers are inside; of our own runs 95 % have at "
    words += f"least {needed}" + (f"; outside: {', '.join(outside)}" if outside else "")
    return words, "in band" if count >= needed else "does not reproduce"


def of_share(share: float, runs: int | None = None) -> Verdict:
    """Verdict on a claim about one run, from the share of our runs in which it is true.

    Args:
        share: of the runs.
        runs: how many; a few cannot tell that a claim is false (95 % confidence). None for many.
    """
    low, high = _BAND
    if share <= low:
        most = share_interval(round(share * runs), runs, 2.0 * _BAND[0])[1] if runs else 0.0
        return "does not reproduce" if most <= _NO_MORE else "in band"
    return "reproduces" if share >= high else "in band"


def less(value: Array, standard_error: Array) -> Array:
    """Whether averages are below zero, and not by chance."""
    return np.asarray(value < -_SIGNIFICANT * standard_error)


def of_points(holds: Array, fails: Array) -> Verdict:
    """Verdict on a claim about averages, from the points where it holds and where it fails."""
    if np.mean(fails) >= _BAND[1]:
        return "does not reproduce"
    return "reproduces" if np.mean(holds) >= _BAND[1] and not np.any(fails) else "in band"


def of_differences(value: Array, standard_error: Array) -> Verdict:
    """Verdict on the claim that averages are below zero at every point."""
    return of_points(less(value, standard_error), less(-value, standard_error))


def worst(verdicts: list[Verdict]) -> Verdict:
    """The least favourable verdict: a table reproduces when all of it does."""
    return min(verdicts, key=_RANK.index)


def together(verdicts: list[Verdict]) -> Verdict:
    """Of a claim of several sentences: in band where some hold and some do not."""
    return verdicts[0] if len(set(verdicts)) == 1 else "in band"


def share_interval(true: int, runs: int, error: float = 0.05) -> tuple[float, float]:
    """Exact (Clopper-Pearson) confidence interval of a share."""
    from scipy.special import betaincinv

    low = float(betaincinv(true, runs - true + 1, error / 2)) if true else 0.0
    high = float(betaincinv(true + 1, runs - true, 1 - error / 2)) if true < runs else 1.0
    return low, high

"""How kashyap's numbers and words are judged, and put into rows.

The paper prints one run of an unknown truth. Truths differ so much that a fit error alone says
little (its band is wide); the ratio of two methods on the same truth says more, so both are judged.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from boresight.experiments.papers.kashyap_study import Study
from boresight.experiments.verdicts import Claim, Verdict, band_of, of_number, of_share, part

Array = Any
Runs = Mapping[str, Mapping[str, Array]]


def row(study: Study, kind: str, name: str, **found: Any) -> Claim:
    """A claim whose place and words stand in the paper's table."""
    stated = study.table[kind][name]
    found.setdefault("published", stated.get("published"))
    return Claim(id=name, where=stated["where"], **found)


def leak(study: Study) -> str:
    """Where a gain comes from: said beside every number that shows one."""
    if study.reading.correction != "same epoch":
        return "No set has a bias to estimate, and no plot is corrected by its own scan's reference"
    return (
        "No set has a bias to estimate: what the error model takes off is each plot's own noise, "
        "which the reference of the same epoch tells it, so the gain is the reference leaking into "
        "the estimate (KA-E1)"
    )


def reasons(study: Study, *names: str) -> str:
    """Why some assumptions are what they are."""
    return "; ".join(study.table["why"][name] for name in names)


def numbers(
    whole: str, published: Mapping[str, Array], ours: Mapping[str, Array], why: str
) -> tuple[Claim, ...]:
    """Printed numbers beside single runs of ours, by name; what fits was made to fit."""
    return tuple(
        part(
            whole,
            name,
            value,
            float(np.median(ours[name])),
            of_number(value, ours[name], fitted=True),
            why,
            band_of(ours[name]),
        )
        for name, value in published.items()
    )


def by_channel(found: Runs) -> dict[str, Array]:
    """Values by method and channel as one list, `emekf azimuth`."""
    return {
        f"{method} {channel}": value
        for method, channels in found.items()
        for channel, value in channels.items()
    }


def ratios(found: Runs, over: str, *methods: str) -> dict[str, Array]:
    """Of methods to another on the same plots, by channel: `emekf/ecmkf azimuth`."""
    return {
        f"{method}/{over} {channel}": value / found[over][channel]
        for method in methods
        for channel, value in found[method].items()
    }


def share(true: Array) -> tuple[float, Verdict]:
    """Of runs in which a sentence is true, and the verdict on it."""
    found = float(np.mean(true))
    return found, of_share(found, np.size(true))


def comparable(study: Study, ratio: Array) -> Array:
    """Whether two things differ by no more than 'roughly similar' allows."""
    return np.abs(np.log(ratio)) <= np.log1p(study.assumed["comparable"])

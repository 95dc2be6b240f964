"""Every filter by name: the only list. `boresight cite NAME` prints where a filter comes from.

Other packages add filters of theirs by entry points (`filters.plugins`); a filter that somebody
holds in the hand is taken wherever a name is.
"""

import re
from importlib import resources
from inspect import getdoc, getmodule
from typing import Any, NamedTuple

from boresight.errors import UsageError, unknown
from boresight.filters import ekf, kalman, mekf, mgekf, plugins, sigma, spherical
from boresight.filters.converted import Converted
from boresight.filters.error_model import correct
from boresight.filters.line_of_sight import LineOfSight
from boresight.filters.method import Filter, Outside
from boresight.filters.modified_polar import ModifiedPolar
from boresight.filters.range_rate import RangeRate
from boresight.mixtures.range_parameterised import RangeParameterised

_FILTERS = {
    f.name: f
    for f in (
        Filter(
            name="kf",
            formula=kalman.update_plot,
            summary="linear Kalman filter, for sensors that measure coordinates",
            paper="kalman1960",
        ),
        Filter(
            name="ekf",
            formula=ekf.update,
            summary="extended Kalman filter, all components at once",
            paper="jazwinski1970",
        ),
        Filter(
            name="ekf-sequential",
            formula=ekf.update_sequential,
            summary="extended Kalman filter, one component after the other",
            paper="jazwinski1970",
        ),
        Filter(
            name="iekf",
            formula=ekf.update_iterated,
            summary="iterated extended Kalman filter (Gauss-Newton)",
            paper="bell1993",
        ),
        Filter(
            name="mekf",
            formula=mekf.update,
            summary="modified extended Kalman filter: elevation, azimuth, then corrected range",
            paper="kashyap",
        ),
        Filter(
            name="mekf-block",
            formula=mekf.update_block,
            summary="modified extended Kalman filter, all components at once",
            paper="aditya",
        ),
        Filter(
            name="mgekf",
            formula=mgekf.update,
            summary="modified gain extended Kalman filter, for bearings",
            paper="pradeep",
        ),
        Filter(
            name="cmkf",
            formula=Converted,
            summary="converted-measurement Kalman filter, conventional conversion",
            paper="kashyap",
            predict=None,
            settings=(("conversion", "conventional"),),
        ),
        Filter(
            name="cmkf-d",
            formula=Converted,
            summary="converted measurements, debiased by what the plot says (CMKF-D-M)",
            paper="lerro1993",
            predict=None,
            settings=(("conversion", "cmkf-d-m"),),
        ),
        Filter(
            name="ucm",
            formula=Converted,
            summary="converted measurements, unbiased",
            paper="mo1998",
            predict=None,
            settings=(("conversion", "ucm"),),
        ),
        Filter(
            name="mucm",
            formula=Converted,
            summary="converted measurements, unbiased given the plot (modified)",
            paper="duan2004",
            predict=None,
            settings=(("conversion", "mucm"),),
        ),
        Filter(
            name="mmse",
            formula=Converted,
            summary="converted measurements, scaled to the least mean square error",
            paper="bordonaro",
            predict=None,
            settings=(("conversion", "mmse"),),
        ),
        Filter(
            name="ducm",
            formula=Converted,
            summary="converted measurements, unbiased, noise taken at the prediction",
            paper="bordonaro",
            predict=None,
            settings=(("conversion", "ducm"),),
        ),
        Filter(
            name="range-rate",
            formula=RangeRate,
            summary="converted position with range rate, correlated noises",
            paper="bordonaro",
            predict=None,
        ),
        Filter(
            name="ukf",
            formula=sigma.unscented,
            summary="unscented Kalman filter",
            paper="julier2004",
            predict=None,
        ),
        Filter(
            name="ckf",
            formula=sigma.cubature,
            summary="cubature Kalman filter",
            paper="arasaratnam2009",
            predict=None,
        ),
        Filter(
            name="iplf",
            formula=sigma.posterior_linearisation,
            summary="iterated posterior linearisation filter",
            paper="garcia2015",
            predict=None,
        ),
        Filter(
            name="ckf-spherical",
            formula=spherical.SphericalCubature,
            summary="cubature Kalman filter with the position in range and angles",
            paper="crouse2014",
            predict=None,
        ),
        Filter(
            name="line-of-sight",
            formula=LineOfSight,
            summary="Gaussians in the frame of the line of sight, bent as flight is there",
            paper="lineofsight",
            predict=None,
        ),
        Filter(
            name="modified-polar",
            formula=ModifiedPolar,
            summary="Kalman filter in modified polar coordinates, for bearings",
            paper="aidala1983",
            predict=None,
        ),
        *(
            Filter(
                name=f"rp-{member}",
                formula=RangeParameterised,
                summary=f"range-parameterised bank of {member} filters, for bearings only",
                paper="pradeep",
                predict=None,
                settings=(("member", member),),
            )
            for member in ("ekf", "mgekf", "ukf", "ckf", "modified-polar")
        ),
    )
}


class _Pass(NamedTuple):
    """What goes over plots before a filter does; fields as in `Filter`."""

    formula: Any
    paper: str = "kashyap"


_PASSES = dict.fromkeys(("error-model", "ecmkf", "emekf"), _Pass(correct))
_THEN = {"ecmkf": ('frame="cartesian"', "kf"), "emekf": ('frame="polar"', "mekf")}


OWN: tuple[str, ...] = tuple(_FILTERS)  # boresight's own, whatever else is installed


def names() -> tuple[str, ...]:
    """Names of all filters: ours, then those that other installed packages offer."""
    return (*OWN, *plugins.offered(_FILTERS))


def lookup(name: Any) -> Filter:
    """The filter of that name, or the filter itself where one is given.

    Raises:
        UsageError: there is none, with the nearest valid name; or it is a function over whole
            recordings, of which there is no step to run.
    """
    found = find(name)
    if isinstance(found, Outside):
        raise UsageError(
            f"{found.name} is a function over whole recordings: there is no step of it to run",
            next_step="give it to bs.run or bs.compare",
        )
    return found


def find(name: Any) -> Filter | Outside:
    """As `lookup`, functions over whole recordings included."""
    if not isinstance(name, str):
        return plugins.as_filter(name)
    if name in _FILTERS:
        return _FILTERS[name]
    if name in _THEN:
        frame, entry = _THEN[name]
        raise UsageError(
            f"{name} is two steps: an error model corrects plots, then a filter runs",
            next_step=f'found = bs.error_model(plots, reference, radar, model="kashyap", {frame}); '
            f'bs.run("{entry}", motion, found.sensor, found.plots)',
        )
    others = plugins.offered(_FILTERS)
    if name in others:
        return plugins.loaded(name, others[name])
    raise unknown("filter", name, [*OWN, *others])


def cite(name: str) -> dict[str, str]:
    """Where a filter, or the error model, is from: `key`, `bibtex`, and how ours `differs`."""
    if name not in _PASSES and name not in (known := names()):
        raise unknown("filter", name, [*known, *_PASSES])
    entry: Any = _PASSES[name] if name in _PASSES else find(name)
    if not getattr(entry, "paper", ""):
        raise UsageError(f"{name} names no paper", next_step="ask whoever wrote it")
    text = (resources.files("boresight") / "papers.bib").read_text(encoding="utf-8")
    found = re.search(rf"^@\w+\{{{re.escape(entry.paper)},.*?^\}}", text, re.MULTILINE | re.DOTALL)
    if found is None:
        raise UsageError(f"papers.bib has no entry {entry.paper!r}, which {name!r} names")
    doc = getdoc(getmodule(entry.formula)) or ""
    differs = re.search(
        r"^Differs from (?:it|them)[:,]\s*(.*?)(?:\n\n|\Z)", doc, re.MULTILINE | re.DOTALL
    )
    return {
        "key": entry.paper,
        "bibtex": found.group(0),
        "differs": " ".join(differs.group(1).split()) if differs else "",
    }

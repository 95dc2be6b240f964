"""A study from a file: which worlds, which filters, what is swept, what is measured.

The whole format, of which two lines are enough (`scenario = "kashyap-set-2"` and
`filter = ["ekf", "mekf"]`); numbers carry their units, see `quantities`::

    name = "my radar"               # usually the file's
    runs = 1000
    seed = 7
    metrics = ["rmse", "nees"]      # any of `study.METRICS`
    first_scan = 10                 # scans before this one are not scored
    false_alarm = "1 %"             # of bands and intervals

    [scenario]                      # kind = "paper" is usual: name = "kashyap-set-2", or:
    kind = "waypoints"              #   points, speed, lateral_accel; scans, site
    points = [["20 km", "-30 km", "3 km"], ["20 km", "40 km", "3 km"]]   # North, East, up
    speed = "220 m/s"               # or one at each point
                                    # "recorded": file, site, target; scans; of a table also
                                    #   columns = { time_s = "ts", latitude_deg = "lat" }
                                    # "random": scans; range and azimuth, or north and east;
                                    #   speed, heading, height, climb: "3 km" always,
                                    #   ["1 km", "9 km"] any between, {mean = "3 km", sd = "1 km"}

    [motion]                        # how targets move, or are believed to on a given path
    kind = "constant-velocity"      # accel; "constant-acceleration": jerk; "static": drift;
    accel = "1 m/s^2"               # "coordinated-turn": accel, turn_accel; dims, discretisation

    [sensor]                        # of a paper's scenario: what differs from the paper's
    period = "4 s"
    range.sigma = "30 m"            # also azimuth, elevation, cone, height, pressure_altitude,
    range.bias = "50 m"             #   range_rate (with correlation); bias: what no filter knows
    azimuth.sigma = "0.1 deg"
    position = ["0 m", "0 m", "15 m"]
    heading = "90 deg"              # of its x axis; carrier.points, carrier.speed: own ship
    detection = "90 %"
    false_plots = 2.5               # expected in a scan, with coverage = "100 km"

    [start]                         # kind = "one plot", "two plots", "on bearing"
    speed_sd = "300 m/s"            # on a bearing: range, range_sd

    [[filter]]                      # as many as wanted
    name = "ukf"                    # of the catalogue, or of an installed package
    label = "cautious"
    motion.accel = "5 m/s^2"        # what it believes, if not the scenario's motion
    noise_scale = 1.3               # factor of the noise variances that it believes
    gate = 16                       # squared Mahalanobis distance; needed with false_plots
    alpha = 0.5                     # further settings are the filter's own

    [sweep]                         # all combinations; of filters: filter.x or filter.LABEL.x
    "sensor.azimuth.sigma" = ["0.5 deg", "2 deg"]

    [split]
    truth = "one"                   # or "each", as noise: own for each run
    [limits]
    converged = "1 km"              # cutoff, order and lost are those of OSPA and GOSPA

A file that is no TOML is bad data; one that says what cannot be is wrongly used, and all that is
wrong with it is told at once.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from boresight.errors import DataError
from boresight.formats.recording import readable
from boresight.laboratory.mistakes import Mistake, StudyError, attempt
from boresight.laboratory.study import (
    USUAL,
    Limits,
    Setting,
    Study,
    check_first_scan,
    first_known,
)
from boresight.laboratory.study_checks import checked
from boresight.laboratory.study_filters import contenders_of
from boresight.laboratory.study_models import StudyFile
from boresight.laboratory.study_worlds import world_of
from boresight.laboratory.sweep import Variant, variants

_LARGEST = 1_000_000  # bytes of a file that somebody wrote
_PLACE = re.compile(r" \(at line (\d+), column (\d+)\)$")


def read_study(path: str | Path, *, runs: int | None = None, seed: int | None = None) -> Study:
    """Read a study.

    Args:
        path: a TOML file as this module's docstring describes it; its recordings are relative
            to its folder.
        runs: instead of the file's.
        seed: instead of the file's.

    Raises:
        MissingInputError: the file is not there or cannot be read.
        DataError: it is no TOML; says where.
        UsageError: a `StudyError`, with everything that is wrong in it.
    """
    file = readable(path)
    text = _text(file)
    study = _study(_toml(file, text), file.name, text, file.parent, file.stem)
    return with_draws(study, runs=runs, seed=seed)


def study_from(
    mapping: Mapping[str, Any], *, runs: int | None = None, seed: int | None = None
) -> Study:
    """A study from what a file would hold; arguments and errors are those of `read_study`.

    Args:
        mapping: as tomllib reads a file; recordings are relative to the working folder.
        runs: instead of the mapping's.
        seed: instead of the mapping's.
    """
    study = _study(dict(mapping), "study", "", Path(), "study")
    return with_draws(study, runs=runs, seed=seed)


def with_draws(study: Study, *, runs: int | None, seed: int | None) -> Study:
    """The study with other runs or another seed; UsageError where they cannot be."""
    changed: dict[str, Any] = {"runs": runs, "seed": seed}
    return replace(study, **{name: each for name, each in changed.items() if each is not None})


def _text(file: Path) -> str:
    """The file's text, with line feeds only, without a byte order mark."""
    content = file.read_bytes() if file.stat().st_size <= _LARGEST else b"\0"
    if b"\0" in content:
        wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
        raise DataError(
            f"{file} is no study: it is {'UTF-16, not UTF-8' if wide else 'no text'}",
            next_step="save it as UTF-8" if wide else "give a study.toml",
        )
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise DataError(
            f"{file} is no study: it is not UTF-8",
            where=f"byte {error.start}",
            next_step="save it as UTF-8",
        ) from None


def _toml(file: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise DataError(f"{file} is no study: its brackets are nested too deep") from None
    except ValueError as error:  # also of a number with thousands of digits
        said = str(error)
        found = _PLACE.search(said)
        where = ""
        if found is not None:
            line, column = (int(each) for each in found.groups())
            where = f"line {line}, column {column}: {text.split(chr(10))[line - 1].strip()}"
        raise DataError(
            f"{file} is not TOML: {_PLACE.sub('', said)[:100]}",
            where=where,
            next_step='tables are [name], settings name = value, text is in quotes: "30 m"',
        ) from None


def _study(raw: dict[str, Any], name: str, text: str, folder: Path, usual_name: str) -> Study:
    """The study, or all its mistakes."""
    mistakes = _missing(raw)
    made = [_setting(each, folder, mistakes) for each in variants(raw, mistakes)]
    if mistakes:
        raise StudyError(name, text, mistakes)
    file, limits = made[0][0], Limits()
    settings = tuple(setting for _, setting in made if setting is not None)
    earliest = max(first_known(each.scenario) for each in settings)
    known = {f"{name}_m": each for name, each in file.limits if name != "order"}
    known |= {"order": file.limits.order}
    return Study(
        name=file.name or usual_name,
        settings=settings,
        runs=file.runs,
        seed=file.seed,
        truth=file.split.truth,
        noise=file.split.noise,
        metrics=tuple(dict.fromkeys(file.metrics or USUAL)),
        first_scan=earliest if file.first_scan is None else file.first_scan,
        limits=replace(limits, **{name: each for name, each in known.items() if each is not None}),
        false_alarm=file.false_alarm or Study.false_alarm,
    )


def _missing(raw: Mapping[str, Any]) -> list[Mistake]:
    """What no study can do without."""
    mistakes = []
    if "scenario" not in raw:
        hint = 'add scenario = "kashyap-set-2", or a table [scenario]'
        mistakes.append(Mistake((), "the study has no scenario", hint))
    if not raw.get("filter", ()):
        mistakes.append(Mistake((), "the study has no filter", 'add filter = ["ekf", "ukf"]'))
    return mistakes


def _setting(
    variant: Variant, folder: Path, mistakes: list[Mistake]
) -> tuple[StudyFile, Setting | None]:
    """One world with its filters; what is wrong is told where the file has it."""
    file, found = checked(variant.raw)
    wrong: list[Mistake] = []
    world = world_of(file, folder, wrong)
    contenders = contenders_of(file.filter, world, wrong)
    if world is not None and file.first_scan is not None:
        attempt(wrong, ("first_scan",), partial(check_first_scan, file.first_scan, world))
    mistakes += [variant.located(each) for each in _causes(found, wrong)]
    if world is None:
        return file, None
    return file, Setting(values=variant.values, scenario=world, contenders=contenders)


def _causes(found: list[Mistake], wrong: list[Mistake]) -> list[Mistake]:
    """What is wrong with the file, and what is wrong with what it says: causes, not effects.

    What a table cannot be made for may follow from what is wrong inside it; that is told alone.
    """
    causes = [*found]
    for each in wrong:
        size = len(each.path)
        inside = [other for other in causes if other.path[:size] == each.path]
        if not any(other in found or len(other.path) > size for other in inside):
            causes.append(each)
    return causes

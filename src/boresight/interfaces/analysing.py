"""The work of `boresight tma`: read, analyse, write down, answer."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.interfaces import door, screens_tma
from boresight.interfaces.answers import Answer
from boresight.interfaces.contacts import tma
from boresight.interfaces.recordings import sha256
from boresight.interfaces.report.tma_facts import told
from boresight.interfaces.terminal import Manner, progress

if TYPE_CHECKING:
    import polars as pl

    from boresight.target_motion.result import TargetMotion, TmaResult

REPORT, TARGET = "report.html", "target.geojson"
HISTORY, HISTORY_CSV = "history.parquet", "history.csv"


def analyse(
    bearings: Path,
    manner: Manner,
    *,
    own_ship: Path,
    folder: Path | None,
    **asked: Any,
) -> Answer:
    """Analyse every contact of a file; with a folder, write the answer down."""
    target = door.folder(folder) if folder else None
    with progress(f"Analysing {bearings.name}", manner):
        found = tma(bearings, own_ship, **asked)
    about = {
        "file": bearings.name,
        "sha256": sha256(bearings),
        "own_ship": own_ship.name,
        "own_ship_sha256": sha256(own_ship),
    }
    outputs = write(found, target, about, manner) if target else []
    return Answer(
        content=content(found, outputs),
        screen=lambda width: screens_tma.analysed(found, outputs, width),
        remarks=[*found.remarks, *remarks_of(found)],
    )


def remarks_of(found: "TmaResult") -> list[str]:
    """What is said of the contacts: of one plainly, of those in full by name, of many of the first.

    The rest is in the report and in the object that --json prints.
    """
    if len(found.contacts) == 1:
        return [*found.main.contact.remarks, *found.main.remarks]
    is_many = len(found.contacts) > screens_tma.FULL
    shown = found.contacts[:1] if is_many else found.contacts
    said = [
        f"{one.contact.name}: {r}" for one in shown for r in (*one.contact.remarks, *one.remarks)
    ]
    others = sum(bool(one.contact.remarks or one.remarks) for one in found.contacts[len(shown) :])
    if others:
        said.append(f"There are remarks on {others} more contacts: see the report, or --json.")
    return said


def write(found: "TmaResult", folder: Path, about: Mapping[str, Any], manner: Manner) -> list[str]:
    """Write the report and the tables into a folder; return the paths."""
    from boresight.formats.output import write_table
    from boresight.interfaces.report import report

    with progress("Writing", manner):
        page = report(motion=found, inspection=dict(about), command=manner.command)
        table = histories(found)
        names = [HISTORY, HISTORY_CSV, *([TARGET] if "latitude_deg" in table.columns else [])]
        paths = [page.save(folder / REPORT)]
        paths += [write_table(table, folder / name, "target motion") for name in names]
    return [str(path) for path in paths]


def histories(found: "TmaResult") -> "pl.DataFrame":
    """Every contact's history in one table; with places on Earth where the plane has one."""
    import polars as pl

    return pl.concat([_history(each) for each in found.contacts], how="diagonal_relaxed")


def _history(one: "TargetMotion") -> "pl.DataFrame":
    import polars as pl

    from boresight.maths.frames import geodetic_from_enu

    table = one.history.select(pl.lit(one.contact.name).alias("track"), pl.all())
    if one.contact.site is None:
        return table
    # A place is told only where the range was.
    known = table["observable"].to_numpy()
    north, east = (table[f"{name}_m"].to_numpy() for name in ("north", "east"))
    plane = np.stack([east, north, 0.0 * north], axis=-1)
    latitude, longitude, _ = geodetic_from_enu(plane, one.contact.site)
    return table.with_columns(
        pl.when(pl.Series(known)).then(pl.Series(latitude)).alias("latitude_deg"),
        pl.when(pl.Series(known)).then(pl.Series(longitude)).alias("longitude_deg"),
    )


def content(found: "TmaResult", outputs: Sequence[str]) -> dict[str, Any]:
    """The object that `boresight tma --json` prints: the busiest contact, then all of them."""
    answers = [told(each) for each in found.contacts]
    return answers[0] | {
        "contacts": answers if len(answers) > 1 else [],
        "remarks": [*found.remarks, *answers[0]["remarks"]],
        "outputs": list(outputs),
    }

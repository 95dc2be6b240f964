"""Reading for the verbs: a frame of plots, and the recording it came from.

`read` gives a plain Polars frame. What else the recording held (ADS-B, where the radar stands) is
kept as long as that frame lives, so that `calibrate(plots, reference="adsb")` can ask for it.
"""

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING
from weakref import finalize

from boresight.maths.frames import Site

if TYPE_CHECKING:
    import polars as pl

    from boresight.formats.recording import Recording

_KNOWN: "dict[int, Recording]" = {}  # by the identity of a frame that is alive


def read(path: str | PathLike[str], *, strict: bool = False) -> "pl.DataFrame":
    """Plots of a recording as a Polars frame.

    Args:
        path: ASTERIX (raw blocks, pcap and the framings recorders use), CSV or Parquet.
        strict: stop at the first damaged block instead of skipping and counting it.

    Raises:
        MissingInputError: the file is not there or cannot be read.
        DataError: the file is not what it should be; names the place.
    """
    from boresight.formats.recording import read_recording

    found = read_recording(Path(path), strict=strict)
    plots = found.plots.clone()  # the recording keeps its own, or no frame would ever be let go
    _KNOWN[id(plots)] = found
    finalize(plots, _KNOWN.pop, id(plots), None)
    return plots


def recording(plots: "pl.DataFrame | str | PathLike[str]") -> "Recording":
    """The recording of a path, or of a frame; of a frame that `read` did not give, its plots."""
    from boresight.formats.recording import Recording, read_recording

    if isinstance(plots, str | PathLike):
        return read_recording(Path(plots))
    import polars as pl

    nothing = pl.DataFrame()
    alone = Recording(
        plots=plots, reference=nothing, system_tracks=nothing, sectors=nothing, summary={}
    )
    return _KNOWN.get(id(plots), alone)


def own_site(read: "Recording", sensor: str | None) -> Site | None:
    """Where a radar says it stands (CAT034, I034/120), if it does; left out, the busiest one."""
    import polars as pl

    if read.sectors.is_empty():
        return None
    name = sensor or read.plots["sensor"].value_counts(sort=True)["sensor"][0]
    mine = read.sectors.filter(pl.col("sensor") == name)
    places = mine.select("latitude_deg", "longitude_deg", "height_m").drop_nulls()
    return Site(**places.row(-1, named=True)) if places.height else None

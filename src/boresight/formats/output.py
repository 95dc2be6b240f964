"""Tables out: Parquet, CSV and GeoJSON, each with the version that wrote it."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boresight.errors import OutputError, UsageError

if TYPE_CHECKING:
    import polars as pl

TABLE_VERSION = "1"
_LINE = ("track", "time_s", "latitude_deg", "longitude_deg")
_NAMES = ("address", "mode_a", "aircraft_id")


def write_table(table: "pl.DataFrame", path: str | Path, kind: str) -> Path:
    """Write a table in the format that the file's name asks for.

    Args:
        table: any table; for GeoJSON, tracks with `track`, `time_s`, `latitude_deg`,
            `longitude_deg` and, if there is one, `height_m`.
        path: ends with .parquet, .csv or .geojson.
        kind: what the table holds ("plots", "tracks", ...), for its metadata.

    Raises:
        UsageError: another ending, or no tracks for GeoJSON.
        OutputError: the file cannot be written.
    """
    file = Path(path)
    about = {"boresight": version("boresight"), "table": kind, "table_version": TABLE_VERSION}
    if file.suffix.lower() not in _WRITERS:
        raise UsageError(
            f"{file} has no format that can be written",
            why=f"known endings: {', '.join(_WRITERS)}",
            next_step=f"name it {file.stem}.parquet",
        )
    with writing(file):
        _WRITERS[file.suffix.lower()](table, file, about)
    return file


@contextmanager
def writing(file: Path) -> Iterator[None]:
    """OutputError where a file cannot be written; Polars words a full disk as its own error."""
    from polars.exceptions import PolarsError

    try:
        yield
    except (OSError, PolarsError) as error:
        if isinstance(error, PolarsError) and "os error" not in str(error):
            raise
        raise OutputError(
            f"{file} cannot be written",
            why=str(getattr(error, "strerror", None) or error).rpartition("IO error: ")[2],
            next_step=f"look at the disk and the folder: df {file.parent}; ls -ld {file.parent}",
        ) from None


def _parquet(table: "pl.DataFrame", file: Path, about: dict[str, str]) -> None:
    with file.open("wb") as opened:
        table.write_parquet(opened, metadata=about)


def _csv(table: "pl.DataFrame", file: Path, about: dict[str, str]) -> None:
    with file.open("wb") as opened:
        opened.write(f"# {json.dumps(about)}\n".encode())
        table.write_csv(opened)


def _geojson(table: "pl.DataFrame", file: Path, about: dict[str, str]) -> None:
    missing = [name for name in _LINE if name not in table.columns]
    if missing:
        raise UsageError(
            f"GeoJSON is for tracks, and this table has no {', '.join(missing)}",
            next_step=f"write it as {file.stem}.parquet",
        )
    content = {"type": "FeatureCollection", "boresight": about, "features": features(table)}
    file.write_text(json.dumps(content, separators=(",", ":")), encoding="utf-8")


_WRITERS = {".parquet": _parquet, ".csv": _csv, ".geojson": _geojson}


def features(table: "pl.DataFrame") -> list[dict[str, Any]]:
    """Return one GeoJSON feature a track: longitude, latitude and, where known, height."""
    placed = table.drop_nulls(["track", "latitude_deg", "longitude_deg"])
    groups = placed.sort("time_s").partition_by("track", maintain_order=True)
    return [_feature(track) for track in groups]


def _feature(track: "pl.DataFrame") -> dict[str, Any]:
    named = {name: _first(track, name) for name in _NAMES if name in track.columns}
    return {
        "type": "Feature",
        "geometry": _geometry(_points(track)),
        "properties": {
            "track": track["track"][0],
            **named,
            "first_s": track["time_s"][0],
            "last_s": track["time_s"][-1],
            "points": track.height,
        },
    }


def _first(track: "pl.DataFrame", name: str) -> Any:
    values = track[name].drop_nulls()
    return values[0] if len(values) else None


def _points(track: "pl.DataFrame") -> list[list[float]]:
    """Return positions: 1e-7 degrees is a centimetre."""
    flat = track.select("longitude_deg", "latitude_deg").rows()
    heights = track["height_m"].to_list() if "height_m" in track.columns else [None] * len(flat)
    return [
        [round(longitude, 7), round(latitude, 7), *([] if height is None else [round(height, 2)])]
        for (longitude, latitude), height in zip(flat, heights, strict=True)
    ]


def _geometry(points: list[list[float]]) -> dict[str, Any]:
    """Return a point, a line, or lines cut at 180 degrees of longitude (RFC 7946, 3.1.9)."""
    lines: list[list[list[float]]] = [points[:1]]
    for point in points[1:]:
        if abs(point[0] - lines[-1][-1][0]) > 180:
            lines.append([])
        lines[-1].append(point)
    if len(points) == 1:
        return {"type": "Point", "coordinates": points[0]}
    long = [line if len(line) > 1 else line * 2 for line in lines]
    if len(long) == 1:
        return {"type": "LineString", "coordinates": long[0]}
    return {"type": "MultiLineString", "coordinates": long}

"""What commands say of the recording they were given."""

import hashlib
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from boresight.errors import DataError


def no_plots(file: Path, summary: Mapping[str, Any]) -> DataError:
    """The error of a recording that holds anything but a radar's plots."""
    held = [f"CAT{row['category']:03d}" for row in summary["categories"] if row["category"]]
    return DataError(
        f"{file} holds no plots to track",
        why=f"it holds {', '.join(held) or 'no records'}; plots are CAT048 or CAT010",
        next_step=f"boresight inspect {shlex.quote(str(file))}",
    )


def sensors(summary: Mapping[str, Any]) -> list[str]:
    """The sensors that a recording has plots of, as `inspect` names them."""
    plots = [row for row in summary["categories"] if row["category"] in (None, 10, 48)]
    return [row["sensor"] for row in plots]


def sha256(file: Path) -> str:
    """The SHA-256 of a file, in hexadecimal."""
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()

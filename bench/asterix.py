"""How fast are ASTERIX recordings decoded? One recording, three decoders, CPU time, medians.

Records a second of `boresight` (file to decoded records, framing and choice of edition included;
and file to Polars tables), of aviconv-asterix and of libasterix, the peers on fewer records, in
the same process, interleaved. Run: `python bench/asterix.py [FILE] [--rounds N]` with the extras
`test` and `bench`; a peer that is not installed is null.
"""

import argparse
import contextlib
import json
import platform
import statistics
import sys
import time
from collections.abc import Callable
from importlib import metadata, resources
from pathlib import Path
from typing import Any

from boresight.formats.decoding import Account
from boresight.formats.recording import read_recording
from boresight.formats.stream import stream
from measure import at_least

# This file is called asterix too, and would be imported in libasterix's place.
sys.path[:] = [folder for folder in sys.path if Path(folder).resolve() != Path(__file__).parent]

RECORDING = Path(__file__).parents[1] / "../shared/data/barcelona-60nm/plots-cat048.ast"
PEER_RECORDS = {"aviconv-asterix": 4_000, "libasterix": 1_500}


def decode(path: Path) -> int:
    return sum(len(batch.records) for batch in stream(path, Account()))


def tables(path: Path) -> int:
    found = read_recording(path)
    frames = (found.plots, found.reference, found.system_tracks, found.sectors)
    return sum(frame.height for frame in frames)


def blocks_of(path: Path) -> list[bytes]:
    """Return blocks, spread over the file; peers read only those of CAT048."""
    data, at, blocks = path.read_bytes(), 0, []
    while at < len(data):
        size = int.from_bytes(data[at + 1 : at + 3], "big")
        if data[at] == 48:
            blocks.append(data[at : at + size])
        at += size
    return blocks


def some(blocks: list[bytes], count: int) -> list[bytes]:
    return blocks[:: max(1, len(blocks) // count)]


def aviconv(blocks: list[bytes]) -> Callable[[], int] | None:
    try:
        from aviconv_asterix import iter_records
    except ImportError:
        return None
    data = b"".join(some(blocks, PEER_RECORDS["aviconv-asterix"]))
    return lambda: sum(1 for _ in iter_records(data))


def libasterix(blocks: list[bytes]) -> Callable[[], int] | None:
    try:
        from asterix import base, generated
    except ImportError:
        return None
    uap = generated.Cat_048_1_32.cv_uap
    bodies = [base.Bits.from_bytes(b[3:]) for b in some(blocks, PEER_RECORDS["libasterix"])]
    return lambda: sum(len(uap.parse(body)) for body in bodies)


def rate(run: Callable[[], int]) -> float:
    begun = time.process_time()
    count = run()
    return count / (time.process_time() - begun)


def measure(path: Path, rounds: int) -> dict[str, Any]:
    blocks = blocks_of(path)
    runs: dict[str, Callable[[], int] | None] = {
        "boresight": lambda: decode(path),
        "boresight, to tables": lambda: tables(path),
        "aviconv-asterix": aviconv(blocks),
        "libasterix": libasterix(blocks),
    }
    rates: dict[str, list[float]] = {name: [] for name in runs}
    for turn in range(rounds + 1):
        for name, run in runs.items():
            if run is not None:
                found = rate(run)
                rates[name] += [found] * (turn > 0)  # the first round warms up
    return {
        name: round(statistics.median(found)) if found else None for name, found in rates.items()
    }


def version(name: str) -> str | None:
    with contextlib.suppress(metadata.PackageNotFoundError):
        return metadata.version(name)
    return None


def processor() -> str:
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="ascii").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor()


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    shipped = resources.files("boresight").joinpath("demo", "recording.ast")
    parser.add_argument("file", nargs="?", type=Path, default=None)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    path = options.file or (RECORDING if RECORDING.is_file() else Path(str(shipped)))
    rates = measure(path, options.rounds)
    ours, peer = rates["boresight"], rates["aviconv-asterix"]
    result = {
        "question": "records decoded a second, CPU time, median",
        "file": path.name,
        "records": decode(path),
        "rounds": options.rounds,
        "records_per_second": rates,
        "times_aviconv": round(ours / peer, 1) if ours and peer else None,
        "targets": {"records decoded a second": at_least(rates["boresight"], 500_000)}
        | ({"times aviconv-asterix": at_least(ours / peer, 30)} if ours and peer else {}),
        "machine": processor(),
        "python": platform.python_version(),
        "versions": {
            name: version(name)
            for name in ("boresight", "numpy", "polars", "aviconv-asterix", "libasterix")
        },
    }
    json.dump(result, sys.stdout, indent=2)
    print()
    return 0


if __name__ == "__main__":
    sys.exit(main())

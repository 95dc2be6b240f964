"""How long whole commands take: help, inspect, track with its report, the demo, and bad input.

Wall time of fresh processes with kernels cached, medians; the largest memory of a process. Uses the
Barcelona hour where it lies beside the checkout, else the demo recording; the bad files are those
of tests/interfaces/test_bad_input.py.
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measure import at_most, machine, publish, summary

ROOT = Path(__file__).parents[1]
BARCELONA = ROOT.parent / "shared/data/barcelona-60nm/plots-cat048.ast"
DEMO = ROOT / "src/boresight/demo/recording.ast"
SITE = ("--site", "41.3007023,2.1020582,27.26")
ROUNDS = 7


def wall(*arguments: str, rounds: int = ROUNDS) -> dict[str, float]:
    """Seconds of `boresight ARGUMENTS`, whatever its exit code."""
    command, seconds = [sys.executable, "-m", "boresight", *arguments], []
    for _ in range(rounds + 1):
        start = time.perf_counter()
        subprocess.run(command, capture_output=True, check=False)
        seconds.append(time.perf_counter() - start)
    return summary(seconds[1:])  # the first fills caches


def bad_input(folder: Path) -> dict[str, float]:
    """Seconds that each bad file takes to be refused."""
    sys.path.insert(0, str(ROOT / "tests/interfaces"))
    sys.path.insert(0, str(ROOT / "tests/formats"))
    from test_bad_input import REFUSED

    found = {}
    for name, (file, octets, *_) in REFUSED.items():
        path = folder / file
        path.write_bytes(octets)
        found[name] = max(wall(c, str(path), rounds=2)["median"] for c in ("inspect", "track"))
    return found


def main() -> None:
    real = BARCELONA.exists()
    file = str(BARCELONA if real else DEMO)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        seconds = {
            "--help": wall("--help"),
            "inspect": wall("inspect", file, "--json"),
            "track": wall("track", file, *(SITE if real else ()), "-o", str(folder / "out")),
            "demo": wall("demo", "-o", str(folder / "demo")),
        }
        refused = bad_input(folder)
    publish(
        "commands",
        {
            "question": "seconds of whole commands, fresh processes",
            "machine": machine("polars", "plotly"),
            "recording": "the Barcelona hour" if real else "the demo recording",
            "seconds": seconds,
            "seconds_to_refuse": refused,
            "largest_process_mb": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024,
            "targets": {
                "boresight --help, s": at_most(seconds["--help"]["median"], 0.5),
                "inspect an hour of plots, s": at_most(seconds["inspect"]["median"], 2.0),
                "track it, report included, s": at_most(seconds["track"]["median"], 5.0),
                "demo, s": at_most(seconds["demo"]["median"], 20.0),
                "slowest bad input, s": at_most(max(refused.values()), 2.0),
            },
        },
    )


if __name__ == "__main__":
    main()

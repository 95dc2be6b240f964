"""How every bench measures: round-robin in one process, CPU time, smallest and median of rounds."""

import gc
import json
import os
import platform
import statistics
import time
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results"


def interleaved(
    tasks: Mapping[str, Callable[[], Any]],
    *,
    rounds: int = 9,
    per: Mapping[str, float] | float = 1.0,
) -> dict[str, dict[str, float]]:
    """CPU seconds of each task divided by `per`, taken in turn so that all share the weather.

    Args:
        tasks: what to time, by name; each is called once before the clock starts.
        rounds: how often each is timed.
        per: units of work in one call, the same for all or one for each name.
    """
    for task in tasks.values():
        task()
    times: dict[str, list[float]] = {name: [] for name in tasks}
    gc.collect()
    for _ in range(rounds):
        for name, task in tasks.items():
            start = time.process_time()
            task()
            times[name].append(time.process_time() - start)
    units = per if isinstance(per, Mapping) else dict.fromkeys(tasks, per)
    return {name: summary([t / units[name] for t in taken]) for name, taken in times.items()}


def summary(values: list[float]) -> dict[str, float]:
    """Smallest, median and number of measurements."""
    return {"min": min(values), "median": statistics.median(values), "rounds": len(values)}


def at_most(value: float, limit: float) -> dict[str, Any]:
    """A target from above, for the table of run_all."""
    return {"is": value, "at_most": limit, "met": bool(value <= limit)}


def at_least(value: float, limit: float) -> dict[str, Any]:
    """A target from below, for the table of run_all."""
    return {"is": value, "at_least": limit, "met": bool(value >= limit)}


def machine(*packages: str) -> dict[str, Any]:
    """Where and with what a figure was taken."""
    cpu = ""
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        cpu = next((x.split(":", 1)[1].strip() for x in lines if x.startswith("model name")), "")
    return {
        "cpu": cpu or platform.processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "load": os.getloadavg() if hasattr(os, "getloadavg") else None,
        "versions": {p: version(p) for p in ("boresight", "numpy", "llvmlite", *packages)},
    }


def version(package: str) -> str | None:
    """Installed version, or None."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def publish(name: str, result: Mapping[str, Any]) -> None:
    """Write bench/results/<name>.json and print it."""
    RESULTS.mkdir(exist_ok=True)
    text = json.dumps(result, indent=2, default=float)
    (RESULTS / f"{name}.json").write_text(text + "\n", encoding="utf-8")
    print(text)

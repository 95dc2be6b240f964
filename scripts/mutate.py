"""Plant faults, one at a time, in a copy of the source, and see whether the laws notice.

    python scripts/mutate.py [--parallel 2] [--only TEXT]

A law that no planted fault breaks is no law. Every fault is a change that a tired person could
make: a sign, a factor, an index, a forgotten square. Each is planted alone in a copy of `src`, and
the fast laws run against that copy in NumPy, stopping at the first failure. Survivors are printed;
the exit code is 1 if fewer than nine in ten are caught.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import faults
import faults_bearings
import faults_calibration
import faults_filters
import faults_laboratory
import faults_registration
import faults_tables
import faults_testing
import faults_tma
from faults import Fault

ROOT = Path(__file__).resolve().parents[1]
_TABLES = (
    faults, faults_filters, faults_calibration, faults_registration, faults_tma, faults_bearings,
    faults_tables, faults_testing, faults_laboratory,
)  # fmt: skip
FAULTS = tuple(fault for table in _TABLES for fault in table.FAULTS)
_JUDGED = {
    prefix: names for table in _TABLES for prefix, names in getattr(table, "JUDGES", {}).items()
}


def _tests(*names: str) -> tuple[str, ...]:
    return tuple(f"tests/{name}.py" for name in names)


KERNELS = _tests(
    *(f"lanes/test_{name}" for name in ("refusals", "program", "elementary", "kernels")),
    *(f"lanes/test_{name}" for name in ("philox", "sums")),
    "laws/test_runs",
    "lanes/test_cache",
)
CONVERSIONS = _tests(
    *(f"models/test_{name}" for name in ("doppler", "conversions_rate")),
    "test_errata_bordonaro",
    "test_least_squares",
    "interfaces/test_convert",
    "models/test_conversions",
)
LAWS = _tests(
    *(f"laws/test_{name}" for name in ("linalg", "motions", "components", "linear_world")),
    *(f"laws/test_{name}" for name in ("textbook", "starts", "smoother", "symmetries")),
)
# Who judges what: the first prefix that fits; tests in the order of what is soonest broken.
JUDGES = {
    "lanes/": KERNELS,
    "filters/recursion": KERNELS,
    "models/conversions": CONVERSIONS,
    "models/polar": CONVERSIONS,
    "models/doppler": CONVERSIONS,
    "filters/least_squares": CONVERSIONS,
    "interfaces/converting": CONVERSIONS,
    "filters/converted": _tests("laws/test_moving_sensor", "laws/test_converted"),
    "filters/sight": _tests("laws/test_moving_sensor", "laws/test_converted"),
    "filters/range_rate": _tests("laws/test_converted", "statistics/test_range_rate"),
    "filters/own_doppler": _tests("statistics/test_own_doppler"),
    "filters/sigma": _tests("laws/test_sigma"),
    "filters/spherical": _tests("laws/test_kept_range", "laws/test_sigma"),
    "filters/line_of_sight": _tests(
        "laws/test_bent_gaussians", "laws/test_line_of_sight", "laws/test_moving_sensor"
    ),
    **{prefix: _tests(*names) for prefix, names in _JUDGED.items()},
    "": LAWS,
}
# What is compiled is judged so; of long recursions that is the quicker way too.
_LONG = ("filters/error_", "mixtures/", "filters/mgekf", "filters/fisher", "filters/batch")
_LONG += ("filters/reversible", "target_motion/observability")
COMPILED = (KERNELS, *(JUDGES[prefix] for prefix in (*_LONG, *faults_laboratory.JUDGES)))
WANTED = 0.9
PATIENCE_S = 900


def caught(fault: Fault) -> bool:
    """Whether the laws fail against a copy of the source with this fault."""
    with tempfile.TemporaryDirectory(prefix="mutant-") as folder:
        copy = Path(folder) / "src"
        shutil.copytree(ROOT / "src", copy, ignore=shutil.ignore_patterns("__pycache__"))
        path = copy / "boresight" / fault.file
        text = path.read_text(encoding="utf-8")
        if fault.old not in text:
            raise SystemExit(f"the fault list is out of date: not found in {fault}")
        path.write_text(text.replace(fault.old, fault.new, 1), encoding="utf-8")
        return not laws_hold(copy, laws_of(fault))


def laws_of(fault: Fault) -> tuple[str, ...]:
    """The tests that judge a fault."""
    return next(laws for prefix, laws in JUDGES.items() if fault.file.startswith(prefix))


def laws_hold(source: Path, laws: tuple[str, ...]) -> bool:
    """Whether the laws hold for a source tree; a crash counts as a broken law, and so does a hang.

    Args:
        source: folder that holds the package.
        laws: tests; formulas are judged in NumPy, the compiler by what it compiles.
    """
    options = ["-n0", "-x", "-q", "--no-header", "--tb=no", "-p", "no:cacheprovider"]
    with tempfile.TemporaryDirectory(prefix="kernels-") as cache:
        environment = {"PYTHONPATH": str(source), "PYTHONDONTWRITEBYTECODE": "1"}
        environment |= {"HYPOTHESIS_PROFILE": "mutants", "BORESIGHT_CACHE": cache}
        environment |= {} if laws in COMPILED else {"BORESIGHT_TARGET": "numpy"}
        try:
            done = subprocess.run(  # noqa: S603 - our own tests
                [sys.executable, "-m", "pytest", *options, *laws],
                cwd=ROOT, env=os.environ | environment, capture_output=True, text=True,
                check=False, timeout=PATIENCE_S,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return False
    if done.returncode > 1:
        raise SystemExit(f"the laws did not run:\n{done.stdout}{done.stderr}")
    return done.returncode == 0


def main() -> int:
    """Plant every fault and report."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--parallel", type=int, default=2)
    parser.add_argument("--only", default="", help="faults whose text contains this")
    options = parser.parse_args()
    chosen = [fault for fault in FAULTS if options.only in str(fault)]
    if not all(laws_hold(ROOT / "src", laws) for laws in set(map(laws_of, chosen))):
        raise SystemExit("the laws do not hold without any fault planted")
    with ThreadPoolExecutor(options.parallel) as pool:
        results = pool.map(caught, chosen)
        survivors = []
        for fault, found in zip(chosen, results, strict=True):
            print("caught  " if found else "SURVIVED", fault, flush=True)
            survivors += [] if found else [fault]
    share = 1 - len(survivors) / len(chosen)
    print(f"{len(chosen) - len(survivors)} of {len(chosen)} faults caught ({100 * share:.0f} %)")
    return 0 if share >= WANTED else 1


if __name__ == "__main__":
    sys.exit(main())

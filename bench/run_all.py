"""Run every bench that can run here, and print what is asked beside what was measured.

What each script prints is kept as bench/results/<name>.json; its `targets` fill the table. A script
whose packages or tools are missing is skipped, and the table says why.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from measure import RESULTS, version

FOLDER = Path(__file__).parent
SCRIPTS: dict[str, tuple[str, ...]] = {  # packages without which there is nothing to compare with
    "kernels": (),
    "filters": (),
    "accuracy": (),
    "peers": ("filterpy", "stonesoup", "dynamax", "nrl-tracker"),
    "registration": (),
    "bearings_only": (),
    "laboratory": ("dynamax",),
    "startup": (),
    "commands": ("pytest",),  # whose tests hold the bad files
    "asterix": ("aviconv-asterix", "libasterix"),
}


def obstacle(name: str, packages: tuple[str, ...]) -> str:
    """Why a script cannot run here; empty if it can."""
    if not (FOLDER / f"{name}.py").exists():
        return "there is no such script"
    missing = [package for package in packages if version(package) is None]
    if missing:
        return f"needs {', '.join(missing)}: pip install 'boresight[bench]'"
    if name == "kernels" and shutil.which("g++") is None:
        return "needs g++ to compare with"
    return ""


def run(name: str) -> str:
    """Run one script; empty, or what went wrong."""
    print(f"bench: {name} ...", file=sys.stderr, flush=True)
    done = subprocess.run(
        [sys.executable, str(FOLDER / f"{name}.py")], capture_output=True, text=True, check=False
    )
    if done.returncode:
        return f"failed: {(done.stderr.strip() or '?').splitlines()[-1]}"
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.json").write_text(done.stdout, encoding="utf-8")
    return ""


def lines(name: str) -> list[str]:
    """A line of the table for every target of a script's result."""
    result: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    table = []
    for label, target in result.get("targets", {}).items():
        relation = "at_most" if "at_most" in target else "at_least"
        verdict = "met" if target["met"] else "MISSED"
        asked = f"{relation.replace('_', ' ')} {target[relation]:g}"
        table.append(f"{name:<9} {label:<48} {target['is']:>10.4g}  {asked:<16} {verdict}")
    return table or [f"{name:<9} done; see bench/results/{name}.json"]


def main() -> int:
    table, failed = [], False
    for name, packages in SCRIPTS.items():
        why = obstacle(name, packages)
        if why:
            table.append(f"{name:<9} skipped: {why}")
            continue
        wrong = run(name)
        failed |= bool(wrong)
        table += [f"{name:<9} {wrong}"] if wrong else lines(name)
    print("\n".join(table))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())

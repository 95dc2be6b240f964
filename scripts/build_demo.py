"""Build the recording that the package ships: `python scripts/build_demo.py`.

An invented sky (`demo_traffic`, flown by `demo_flight`) is observed by a radar with known errors
(`demo_radar`) and heard by an ADS-B station (`demo_adsb`); what they report is written as ASTERIX
(`demo_asterix`), beside the truth (`demo_truth`) and the planted facts. The bytes are shipped, not
built by the user: a rounding that differs between processors may flip a quantum.
"""

import json
import platform
from dataclasses import asdict
from pathlib import Path

import numpy as np
import polars as pl

import demo_adsb
import demo_asterix
import demo_radar
import demo_truth
from demo_flight import DURATION_S, SITE
from demo_flight import Path as FlownPath
from demo_traffic import CODE_CHANGE_S, sky

SEED = 2026
FOLDER = Path(__file__).parents[1] / "src" / "boresight" / "demo"


def main() -> None:
    """Build the three files, and print what they hold and how large they are."""
    paths = sky(SEED)
    reports = demo_radar.observe(paths, SEED)
    broadcasts = demo_adsb.broadcast(paths, SEED)
    stream, counts = demo_asterix.recording(reports, broadcasts)
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / "recording.ast").write_bytes(stream)
    truth = demo_truth.truth(paths, demo_asterix.EPOCH_S)
    truth.write_parquet(FOLDER / "truth.parquet", compression="zstd", compression_level=19)
    stated = facts(paths, reports, counts)
    (FOLDER / "facts.json").write_text(json.dumps(stated, indent=1) + "\n", encoding="utf-8")
    sizes = {path.name: path.stat().st_size for path in sorted(FOLDER.iterdir())}
    print(json.dumps({"counts": stated["counts"], "bytes": sizes}, indent=1))


def facts(
    paths: list[FlownPath], reports: pl.DataFrame, counts: dict[str, int]
) -> dict[str, object]:
    """State everything that was planted, and how many of what."""
    kinds = dict(reports["kind"].value_counts().sort("kind").iter_rows())
    flagged = {name: int(reports[name].sum()) for name in ("mode_a_garbled", "level_garbled")}
    delays = demo_radar.transponder_delays_m(len(paths), SEED)
    flights = [
        {**path.flight.identity, "kind": path.flight.kind, "transponder_delay_m": round(delay, 2)}
        for path, delay in zip(paths, delays.tolist(), strict=True)
    ]
    return {
        "about": "Everything here is invented: radar, airports, aircraft, addresses, callsigns.",
        "site": asdict(SITE),
        "epoch_s": demo_asterix.EPOCH_S,
        "duration_s": DURATION_S,
        "radar": demo_radar.facts(),
        "adsb": demo_adsb.facts(paths),
        "height": "height_m = 1.02 pressure_altitude_m + 35 m + 12 m of weather over 150 km",
        "code_change_s": demo_asterix.EPOCH_S + CODE_CHANGE_S,
        "truth": {"interpolation": "cubic Hermite", "tolerance_m": demo_truth.TOLERANCE_M},
        "counts": {**counts, "flights": len(paths), **kinds, **flagged},
        "editions": {f"cat{c:03d}": name for c, name in demo_asterix.EDITIONS.items()},
        "flights": flights,
        "built": {"seed": SEED, "numpy": np.__version__, "python": platform.python_version()},
    }


if __name__ == "__main__":
    main()

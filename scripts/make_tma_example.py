"""Write examples/tma: bearings, own ship's log and the truth of the scenario of [pradeep].

A target at 4000 m on 045 runs 120 at 15.45 m/s. Own ship runs 090 at 10.3 m/s, turns to port to
270 at 120 s and back to starboard to 090 at 540 s, both at 3 degrees a second. Bearings are heard
every second to 0.33 degrees; one in twenty is missing, and 30 s in one piece.

    python scripts/make_tma_example.py
"""

from pathlib import Path

import numpy as np
import polars as pl

from boresight.maths.frames import Site, geodetic_from_enu

FOLDER = Path(__file__).parent.parent / "examples" / "tma"
PLACE = Site(latitude_deg=43.2, longitude_deg=8.0, height_m=0.0)
SIGMA_DEG, SEED = 0.33, 1929
TARGET_MPS, OWN_MPS, SECONDS = 15.45, 10.3, 800


def own_ship() -> np.ndarray:
    """(seconds + 1, 2) North and East; each second is sailed on the course at its beginning."""
    time_s = np.arange(SECONDS)
    turned = np.clip(3.0 * (time_s - 540), 0, 180) - np.clip(3.0 * (time_s - 120), 0, 180)
    return np.vstack([np.zeros(2), np.cumsum(along(OWN_MPS, 90.0 + turned), axis=0)])


def along(length_m: float, direction_deg: float | np.ndarray) -> np.ndarray:
    """(..., 2) so many metres North and East in a direction."""
    angle = np.radians(direction_deg)
    return length_m * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def places(position_m: np.ndarray) -> dict[str, np.ndarray]:
    """Latitude and longitude of North and East, to a centimetre."""
    north, east = position_m.T
    where = geodetic_from_enu(np.stack([east, north, 0 * north], axis=-1), PLACE)
    return {"latitude_deg": where[0].round(7), "longitude_deg": where[1].round(7)}


def main() -> None:
    """Write the three tables."""
    time_s = np.arange(SECONDS + 1)
    own = own_ship()
    target = along(4000.0, 45.0) + time_s[:, None] * along(TARGET_MPS, 120.0)
    north, east = (target - own).T
    bearing = np.degrees(np.arctan2(east, north))
    rng = np.random.default_rng(SEED)
    heard = ((bearing + SIGMA_DEG * rng.standard_normal(len(time_s))) % 360).round(2)
    kept = (rng.uniform(size=len(time_s)) > 0.05) & ((time_s < 300) | (time_s >= 330))
    bearings = pl.DataFrame({"time_s": time_s, "bearing_deg": heard, "sigma_deg": SIGMA_DEG})
    truth = pl.DataFrame({
        "time_s": time_s, **places(target), "range_m": np.hypot(north, east).round(1),
        "bearing_deg": (bearing % 360).round(3), "course_deg": 120.0, "speed_mps": TARGET_MPS,
    })  # fmt: skip
    FOLDER.mkdir(parents=True, exist_ok=True)
    bearings.filter(pl.Series(kept)).write_csv(FOLDER / "bearings.csv")
    pl.DataFrame({"time_s": time_s, **places(own)}).write_csv(FOLDER / "own-ship.csv")
    truth.gather_every(10).write_csv(FOLDER / "truth.csv")


if __name__ == "__main__":
    main()

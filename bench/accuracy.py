"""How near does each filter come to the best that any could do?

Bordonaro's dynamic scenario at three bearing noises: straight flight 14,142 ft out, range noise
100 ft, a plot a second. Truths are drawn from the filters' own prior and every filter starts from
the first plot in its own way; errors are held against those of the exact posterior (importance
sampling) on the same runs, after 100 plots. Intervals are paired, 99 %.
"""

import numpy as np

from boresight import catalogue
from boresight.experiments.against_posterior import against_posterior
from boresight.experiments.posterior import Flight
from boresight.models.sensors import Radar
from measure import machine, publish

RUNS, SEED, SCANS = 2000, 21, 100
ANGLES_DEG = (1.0, 5.0, 10.0)
COLUMNS = (
    "filter",
    "position_ratio",
    "position_low",
    "position_high",
    "velocity_ratio",
    "anees",
    "least_ess",
)


def main() -> None:
    filters = {name: catalogue.lookup(name) for name in catalogue.names() if name != "kf"}
    tables = {}
    for angle in ANGLES_DEG:
        sensor = Radar(range_m=100.0, azimuth_deg=angle)
        flight = Flight(sensor=sensor, range_m=1e4 * np.sqrt(2), speed_mps=30.0, scans=SCANS)
        found = against_posterior(flight, filters, at=(SCANS - 1,), runs=RUNS, seed=SEED)
        tables[f"{angle:g} degrees"] = found.select(COLUMNS).to_dicts()
    publish(
        "accuracy",
        {
            "question": "errors of every filter over those of the exact posterior, after 100 plots",
            "machine": machine("scipy"),
            "runs": RUNS,
            "tables": tables,
        },
    )


if __name__ == "__main__":
    main()

"""What the demo's builder states, and the physics that its tests work out again by themselves."""

import json
from importlib.resources import files

import numpy as np

from boresight.maths import frames

MB, NM = 1e6, 1852.0
FOLDER = files("boresight") / "demo"
FACTS = json.loads((FOLDER / "facts.json").read_text(encoding="utf-8"))
RADAR = FACTS["radar"]
SITE = frames.Site(**FACTS["site"])
PLANTED = [RADAR["range_bias_m"], RADAR["azimuth_bias_deg"], RADAR["time_bias_s"]]


def excess(range_m, height_m):
    """The air's delay by plain summation along a straight line over a round Earth."""
    air, earth = RADAR["atmosphere"], 6.371e6
    start, end = earth + SITE.height_m, earth + height_m
    sine = (end**2 - start**2 - range_m**2) / (2 * range_m * start)
    along = (np.arange(200) + 0.5) / 200 * range_m[:, None]
    radius = np.sqrt(start**2 + along**2 + 2 * start * along * sine[:, None])
    index = air["surface_refractivity"] * np.exp(-(radius - earth) / air["scale_height_m"])
    return 1e-6 * index.mean(axis=1) * range_m

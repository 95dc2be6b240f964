"""Tables of bearings and of own ship, made on the spot; and one contact of both."""

import numpy as np
import polars as pl

from boresight.target_motion.contacts import contacts

SIGMA = 0.5


def ship(count=101, dt=1.0, **more):
    """East at 5 m/s."""
    t = dt * np.arange(count)
    return pl.DataFrame({"time_s": t, "north_m": 0.0 * t, "east_m": 5.0 * t, **more})


def heard(count=101, dt=1.0, seed=1, **more):
    """A contact on 060, falling back by 0.2 degrees a second, with an error of half a degree."""
    t = dt * np.arange(count)
    noise = SIGMA * np.random.default_rng(seed).normal(size=count)
    return pl.DataFrame({"time_s": t, "bearing_deg": 60 + 0.2 * t + noise, **more})


def said(remarks, *words):
    return any(all(word in each for word in words) for each in remarks)


def one(bearings, own_ship, **options):
    (found,), remarks = contacts(bearings, own_ship, **options)
    return found, remarks

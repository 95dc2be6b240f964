"""Contacts with every state of knowledge, for pages and screens: made, not analysed.

Formulas are simple on purpose: a page is held against what it was given, not against the truth.
"""

from dataclasses import replace

import numpy as np
import polars as pl

from boresight.target_motion.contact import Contact
from boresight.target_motion.result import (
    Batch,
    Cells,
    Convergence,
    Criteria,
    Observability,
    Quantity,
    Residuals,
    Side,
    TargetMotion,
    Test,
    TmaResult,
)

OWN_MPS, SIGMA_DEG, TURN_S = 10.3, 0.33, 120
RANGE_M = np.geomspace(1_500.0, 16_000.0, 6)  # of the cells


def own_ship(steps, *, turns=True):
    """(steps, 2) and (steps, 2): East, then 180 degrees to port from `TURN_S` on; 1 s apart."""
    heading = np.full(steps, 90.0)
    if turns:
        heading -= np.clip(3.0 * (np.arange(steps) - TURN_S), 0.0, 180.0)
    velocity = OWN_MPS * np.stack([np.cos(np.radians(heading)), np.sin(np.radians(heading))], 1)
    return np.vstack([np.zeros((1, 2)), np.cumsum(velocity[:-1], axis=0)]), velocity


def contact(name="a", steps=801, *, turns=True, conical=False, seed=1, start=(2800.0, 2800.0)):
    """A contact of one bearing a second, a tenth of them missing; and its true track."""
    rng, time = np.random.default_rng(seed), np.arange(float(steps))
    own, velocity = own_ship(steps, turns=turns)
    track = np.array(start) + np.outer(time, [-4.0, 6.0])
    seen = np.arctan2(*(track - own).T[::-1])
    heard = seen + np.radians(SIGMA_DEG) * rng.standard_normal(steps)
    heard[rng.uniform(size=steps) < 0.1 * (steps > 10)] = np.nan
    axis, nothing = np.arctan2(velocity[:, 1], velocity[:, 0]), np.full(steps, np.nan)
    made = Contact(
        name=name, time_s=time,
        bearing_rad=nothing if conical else heard,
        cone_rad=np.abs((heard - axis + np.pi) % (2 * np.pi) - np.pi) if conical else nothing,
        sigma_rad=np.full(steps, np.radians(SIGMA_DEG)),
        position_m=own, velocity_mps=velocity, axis_rad=axis if conical else nothing,
        remarks=("a made contact",),
    )  # fmt: skip
    return made, track


def quantity(middle, sd, *, known=True, pieces=1):
    """One quantity; `known=False` leaves its regions alone, `pieces=2` parts them."""
    half = {"50": 0.67 * sd, "90": 1.64 * sd, "99": 2.58 * sd}
    ends = {level: ((middle - each, middle + each),) for level, each in half.items()}
    if pieces == 2:
        ends = {level: (*each, (middle + 4 * sd, middle + 5 * sd)) for level, each in ends.items()}
    return Quantity(estimate=middle if known else None, sd=sd if known else None, regions=ends)


def motion(
    name="a", steps=801, *, turns=True, conical=False, decided=True, seed=1, start=(2800.0, 2800.0)
):
    """What an analysis says of a contact: the range is known from 30 s after the turn."""
    heard, track = contact(name, steps, turns=turns, conical=conical, seed=seed, start=start)
    time, own = heard.time_s, heard.position_m
    away = np.hypot(*(track - own).T)
    known = turns & (time >= TURN_S + 30)
    sd = {"range": away * np.where(known, 4.0 / np.maximum(time - TURN_S, 1.0) + 0.01, 0.4)}
    sd["bearing"] = SIGMA_DEG / np.sqrt(np.minimum(time + 1, 40.0))
    sd["course"] = np.where(known, 150.0 / np.maximum(time - TURN_S, 1.0), 90.0)
    sd["speed"] = np.where(known, 90.0 / np.maximum(time - TURN_S, 1.0), 2.5)
    bearing = np.degrees(np.arctan2(*(track - own).T[::-1])) % 360
    here = {
        "range": away,
        "bearing": bearing,
        "course": 123.69 + 0 * time,
        "speed": 7.21 + 0 * time,
    }
    units = {"range": "m", "bearing": "deg", "course": "deg", "speed": "mps"}
    rows = {f"{q}_{units[q]}": here[q] + 0.4 * sd[q] * np.sin(time / 90) for q in here}
    rows |= {f"{q}_sd_{units[q]}": sd[q] for q in here}
    rows |= {f"{q}_bound_{units[q]}": 0.9 * sd[q] for q in here}
    deg = np.degrees(heard.bearing_rad if not conical else heard.cone_rad + heard.axis_rad)
    angle = np.radians(rows["bearing_deg"])
    history = pl.DataFrame(
        {"time_s": time, "own_north_m": own[:, 0], "own_east_m": own[:, 1], "heard_deg": deg % 360}
        | {"north_m": own[:, 0] + rows["range_m"] * np.cos(angle)}
        | {"east_m": own[:, 1] + rows["range_m"] * np.sin(angle)}
        | rows
        | {
            "range_low_m": np.maximum(away - 1.64 * sd["range"], 200.0),
            "range_high_m": away + 1.64 * sd["range"],
            "innovation_deg": 0.0 * time,
            "innovation_sd_deg": SIGMA_DEG + 0.0 * time,
            "nis": 1.0 + 0.0 * time,
            "observable": known,
        }
    )
    last = {q: (float(rows[f"{q}_{units[q]}"][-1]), float(sd[q][-1])) for q in here}
    observable = bool(known[-1])
    told = {
        f"{q}_{units[q]}": quantity(*last[q], known=observable or q == "bearing", pieces=1)
        for q in last
    }
    sides = ()
    if conical:
        share = 0.998 if decided else 0.56
        other = told | {"bearing_deg": quantity(2 * 270.0 - last["bearing"][0], 0.1)}
        sides = (
            Side(name="starboard", probability=share, **told),
            Side(name="port", probability=1 - share, **other),
        )
    if conical and not decided:  # between the sides there is nothing
        told |= {"bearing_deg": quantity(*last["bearing"], known=False)}
    mean = np.array([*track[-1], -4.0, 6.0])
    cov = np.diag([last["range"][1] ** 2, (0.3 * last["range"][1]) ** 2, 0.1, 0.1])
    noise = np.degrees(heard.sigma_rad) * np.random.default_rng(7).standard_normal(steps)
    deg = np.where(np.isnan(deg), np.nan, noise)
    scatter = "The bearings scatter by 1.02 times their stated noise."
    together = "Neighbouring residuals go together (correlation 0.31)."
    tests = (
        Test(name="noise level", statistic=1.02, p_value=0.4, passed=True, words=scatter),
        Test(name="whiteness", statistic=2.4, p_value=0.0004, passed=False, words=together),
    )
    weights = np.exp(-0.5 * (np.log(RANGE_M / away[-1]) * time[:, None] / 60) ** 2)
    side = np.zeros(6)
    if conical:
        side = np.repeat([-1.0, 1.0], 6)
        late = np.where(time > TURN_S, time - TURN_S, 0)[:, None] if decided else 0 * time[:, None]
        weights = np.hstack([weights * np.exp(-late / 20), weights])
    return TargetMotion(
        contact=heard, filter="rp-ekf", bearings=int(np.isfinite(deg).sum()), criteria=Criteria(),
        observability=Observability(
            observable=observable, since_s=float(TURN_S + 30) if observable else None,
            range_sd_m=float(sd["range"][-1]) if observable else float("inf"),
            at_best_percent=2.0 if turns and steps > TURN_S else float("inf"),
            manoeuvred=turns and steps > TURN_S, by_step=sd["range"],
        ),
        convergence=Convergence(
            first_s=148.0 if observable else None, sustained_s=170.0 if observable else None,
            permitted_s=145.0 if observable else None,
        ),
        **told, mean=mean, cov=cov, sides=sides, decided=decided, history=history,
        cells=Cells(
            range_m=np.tile(RANGE_M, 2 if conical else 1), side=side,
            weights=weights / weights.sum(1, keepdims=True),
            mean=_means(own, bearing, 2 if conical else 1),
        ),
        batch=Batch(mean=mean, cov=cov, cost=400.0, converged=True, **told),
        residuals=Residuals(deg=deg, tests=tests, false_alarm=0.01),
        settings={"cells": 6, "nearest_m": 1000.0, "farthest_m": 20000.0},
        remarks=("what the reader must know", together),
    )  # fmt: skip


def _means(own, bearing, sides):
    """(cells, 4): on the last bearing at the cells' ranges, at rest; the last cell is given up."""
    angle = np.radians(bearing[-1])
    away = np.outer(np.tile(RANGE_M, sides), [np.cos(angle), np.sin(angle)])
    mean = np.hstack([own[-1] + away, 0.0 * away])
    mean[-1] = np.nan
    return mean


def states():
    """One contact for each state of knowledge, by name."""
    known = motion("known")
    parted = quantity(5_000.0, 300.0, pieces=2)
    gone = known.history.with_columns(
        pl.when(pl.col("time_s") < 60).then(None).otherwise(pl.col(name)).alias(name)
        for name in ("range_m", "range_sd_m", "course_deg", "north_m", "range_low_m")
    )
    never = Convergence(first_s=148.0, sustained_s=None, permitted_s=None)
    return {
        "known": known,
        "not for good": replace(known, convergence=never),
        "no turn": motion("no turn", turns=False),
        "too little": motion("too little", 140),
        "sides": motion("sides", turns=False, conical=True, decided=False),
        "side decided": motion("side decided", conical=True),
        "three": motion("three", 3, turns=False),
        "in pieces": replace(known, range_m=parted),
        "bare": replace(known, batch=None, residuals=None, settings={}, remarks=()),
        "gaps": replace(known, history=gone),
    }


def many(count=43):
    """A file of many contacts, most of which nothing is known of."""
    rng = np.random.default_rng(5)
    kinds = (
        {"turns": True},
        {"turns": False},
        {"turns": False, "conical": True, "decided": False},
    )
    made = []
    for i in range(count):
        start = rng.uniform(-4e3, 4e3, 2)
        made.append(motion(f"track {i + 1}", 600 - 12 * i, seed=i, start=start, **kinds[i % 3]))
    return TmaResult(contacts=tuple(made), remarks=("a made file",))

"""How long does a registration take, beside SciPy's least squares on the same problem?

Six systematic errors from a million pairs of 2,000 aircraft. SciPy gets residuals in standard
deviations and their dense Jacobian, all places taken anew at every step, from zero. The
registration solves the same problem when heavy tails, outliers and delays are switched off. As it
comes (all of that on, a twentieth of the references wrong) it is timed beside.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from boresight.calibration.pairs import Pairs
from boresight.calibration.registration import Registration, register
from measure import at_least, at_most, interleaved, machine, publish

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "calibration"))
from radar_worlds import SIX, Noise, world

Array = Any
PAIRS, TARGETS, SEED, ROUNDS = 1_000_000, 2_000, 12, 3


def peer(pairs: Pairs, sd: Array, tolerance: float = 1e-8) -> Array:
    """SciPy's answer for normal noise of these standard deviations (2,); its own tolerance."""
    p, v = pairs.position, pairs.velocity

    def at(terms: Array) -> tuple[Array, Array, Array]:
        q = p - terms[5] * v
        flat2 = q[:, 0] ** 2 + q[:, 1] ** 2
        return q, np.sqrt(flat2), np.sqrt(flat2 + q[:, 2] ** 2)

    def residuals(terms: Array) -> Array:
        q, flat, r = at(terms)
        cos, sin = q[:, 0] / flat, q[:, 1] / flat
        error = np.radians(terms[2] + terms[3] * cos + terms[4] * sin)
        azimuth = pairs.z[:, 1] - np.arctan2(q[:, 1], q[:, 0]) - error
        azimuth = (azimuth + np.pi) % (2.0 * np.pi) - np.pi
        distance = pairs.z[:, 0] - r - terms[0] - terms[1] * r / 1e3
        return np.concatenate([distance / sd[0], azimuth / sd[1]])

    def jacobian(terms: Array) -> Array:
        q, flat, r = at(terms)
        m, one = len(r), np.radians(1.0)
        J = np.zeros((2 * m, 6))
        J[:m, 0], J[:m, 1] = -1.0, -r / 1e3
        J[:m, 5] = (q * v).sum(1) / r
        J[m:, 2], J[m:, 3], J[m:, 4] = -one, -one * q[:, 0] / flat, -one * q[:, 1] / flat
        J[m:, 5] = (q[:, 0] * v[:, 1] - q[:, 1] * v[:, 0]) / flat**2
        J[:m] /= sd[0]
        J[m:] /= sd[1]
        return J

    return least_squares(
        residuals, np.zeros(6), jac=jacobian, x_scale="jac", ftol=tolerance, xtol=tolerance
    ).x


def noise_sd(found: Registration) -> Array:
    laws = found.noise.laws
    return np.array([laws["range_m"].sd, np.radians(laws["azimuth_deg"].sd)])


def main() -> None:
    normal, _ = world(SEED, pairs=PAIRS, targets=TARGETS)
    spoilt = Noise(azimuth_tail=(0.15, 3.0), delay_m=30.0, wrong_share=0.05)
    rough, _ = world(SEED, pairs=PAIRS, targets=TARGETS, noise=spoilt)
    found = register(normal, SIX, robust=False, delays=False)
    sd = noise_sd(found)
    tasks = {
        "registration": lambda: register(normal, SIX, robust=False, delays=False),
        "scipy": lambda: peer(normal, sd),
        "registration, as it comes": lambda: register(rough, SIX),
    }
    times = interleaved(tasks, rounds=ROUNDS)
    alone = np.array([term.independent_sd for term in found.terms.values()])
    estimate = np.array([term.estimate for term in found.terms.values()])
    apart = float(np.abs((estimate - peer(normal, sd, 1e-14)) / alone).max())
    least = {name: value["min"] for name, value in times.items()}
    publish(
        "registration",
        {
            "question": "CPU seconds of a registration of a million pairs, and against SciPy",
            "machine": machine("scipy"),
            "pairs": PAIRS,
            "cpu_s": times,
            "apart_in_sd": apart,
            "targets": {
                "CPU s, as it comes": at_most(least["registration, as it comes"], 10.0),
                "times faster than least_squares": at_least(
                    least["scipy"] / least["registration"], 5.0
                ),
                "apart from it, sd": at_most(apart, 1e-3),
            },
        },
    )


if __name__ == "__main__":
    main()

"""Bounds of a tone's frequency and bearing: against the information of its samples, summed up."""

import numpy as np
import pytest

from boresight.models.tone import bearing_sd, frequency_sd

RATE, SPACING = 2000.0, 0.5


def heard(parameters, samples, elements):
    """Noise-free complex samples (samples, elements): amplitude, phase, frequency, bearing."""
    amplitude, phase, hertz, bearing = parameters
    time, place = np.arange(samples)[:, None] / RATE, SPACING * np.arange(elements)
    turns = hertz * time + place * np.sin(bearing)
    return amplitude * np.exp(1j * (phase + 2.0 * np.pi * turns))


def numeric(snr, samples, elements, bearing):
    """Inverse of the Fisher information of all four, noise of power one, by differences."""
    at, steps = np.array([np.sqrt(snr), 0.4, 130.0, bearing]), (1e-5, 1e-5, 1e-4, 1e-5)
    slopes = []
    for i, step in enumerate(steps):
        off = step * np.eye(4)[i]
        gap = heard(at + off, samples, elements) - heard(at - off, samples, elements)
        slopes.append(gap.ravel() / (2.0 * step))
    J = np.array(slopes)
    return np.sqrt(np.diag(np.linalg.inv(2.0 * (J.conj() @ J.T).real)))


@pytest.mark.parametrize(
    ("snr", "samples", "elements", "bearing"),
    [(10.0, 64, 16, 0.0), (0.3, 33, 2, 1.1), (4.0, 2, 5, -0.6)],
)
def test_bounds_are_those_of_the_samples(snr, samples, elements, bearing):
    *_, hertz, angle = numeric(snr, samples, elements, bearing)
    found = frequency_sd(snr, samples=samples, rate_hz=RATE, elements=elements)
    assert found == pytest.approx(hertz, rel=1e-6)
    found = bearing_sd(snr, elements=elements, spacing=SPACING, bearing=bearing, samples=samples)
    assert found == pytest.approx(angle, rel=1e-6)


def test_the_best_estimate_of_a_strong_tone_reaches_the_bound():
    """The peak of the spectrum is the most likely frequency; 400 records, 3 standard errors."""
    rng, snr, samples, runs = np.random.default_rng(5), 30.0, 32, 400
    noise = rng.normal(size=(2, runs, samples)) / np.sqrt(2.0)
    record = heard((np.sqrt(snr), 0.4, 130.0, 0.0), samples, 1)[:, 0] + noise[0] + 1j * noise[1]
    grid = np.linspace(110.0, 150.0, 8001)
    matched = np.exp(-2j * np.pi * np.outer(np.arange(samples) / RATE, grid))
    best = grid[np.argmax(np.abs(record @ matched), axis=1)]
    share = np.std(best) / frequency_sd(snr, samples=samples, rate_hz=RATE)
    assert abs(share - 1.0) <= 3.0 / np.sqrt(2.0 * runs)

"""How well an array can hear a tone: the least errors of its frequency and of its bearing.

[kay1993] S. M. Kay, "Fundamentals of Statistical Signal Processing: Estimation Theory", chapter 3.
[bordonaro] section 4.2 takes from there what its Doppler bias is held against.
Differs from it: samples are complex, and every element of the array gives as many, so one record
tells both numbers. The tone's phase is a plane over time and place: its slope over time is the
frequency, its slope along the array the bearing. Seen from the middle of record and array neither
slope says anything of the other, of the phase or of the amplitude, so all four may be unknown.
"""

from typing import Any

import numpy as np


def frequency_sd(snr: Any, *, samples: Any, rate_hz: Any, elements: Any = 1) -> Any:
    """Least standard deviation of a tone's frequency, Hz.

    Args:
        snr: power of the tone over that of the noise, of one sample of one element.
        samples: of the record, two or more.
        rate_hz: complex samples a second.
        elements: that hear it.
    """
    return rate_hz / (2.0 * np.pi) * _slope_sd(snr, samples, elements)


def bearing_sd(
    snr: Any, *, elements: Any, spacing: Any, bearing: Any = 0.0, samples: Any = 1
) -> Any:
    """Least standard deviation of a tone's bearing by a straight array, rad.

    Args:
        snr: power of the tone over that of the noise, of one sample of one element.
        elements: of the array, evenly spaced, two or more.
        spacing: of the elements, in wavelengths, which are known.
        bearing: rad, from the direction across the array.
        samples: of the record.
    """
    return _slope_sd(snr, elements, samples) / (2.0 * np.pi * spacing * np.cos(bearing))


def _slope_sd(snr: Any, steps: Any, rows: Any) -> Any:
    """Of the phase, rad a step, from rows of so many samples a step apart.

    The information of the phase of one complex sample is 2 snr; the squares of the steps' distances
    from their middle add up to steps (steps² - 1) / 12.
    """
    return np.sqrt(6.0 / (snr * rows * steps * (steps**2 - 1.0)))

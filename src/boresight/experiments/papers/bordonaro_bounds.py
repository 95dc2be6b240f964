"""bordonaro's bounds of bearing and frequency (section 4.2), and the bias beside errors that small.

Bounds are those of `models.tone`, of one ping heard by a line of elements: the same record tells
bearing and frequency.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from boresight.experiments.papers import bordonaro_doppler as doppler
from boresight.experiments.papers.bordonaro_study import Study
from boresight.experiments.papers.bordonaro_words import reasons, row
from boresight.experiments.verdicts import Claim, part, said, together
from boresight.models.tone import bearing_sd, frequency_sd

Array = Any
_OPEN = ("bound_snr_db", "bound_elements", "bound_spacing", "bound_samples", "bound_rate_hz")
_SLANT = np.radians(60.0)
_TWICE, _FARTHER = "times as large where doubled: ", "times as large at 60° as at 0°"


def bounds(study: Study) -> Claim:
    """BO-M11: what the bounds depend on, and how significant the bias is beside them."""
    parts = (_bearing(study), _frequency(study), _significance(study))
    return row(
        study,
        "methods",
        "BO-M11",
        ours=_values(study),
        verdict=together([each.verdict for each in parts]),
        assumption=f"{reasons(study, *_OPEN)}. The same ping tells bearing and frequency, so more "
        "elements better both bounds: for one signal, not one signal to noise after the array",
        parts=parts,
    )


def _sonar(study: Study) -> dict[str, float]:
    """The assumed one, its numbers by name; with the shortest array."""
    assumed = study.assumed
    return {
        "signal to noise": 10.0 ** (assumed["bound_snr_db"] / 10.0),
        "wavelength": 1.0,
        "elements": float(min(assumed["bound_elements"])),
        "record": float(assumed["bound_samples"]),
        "bearing": 0.0,
    }


def _bearing_sd(study: Study, sonar: dict[str, Any]) -> Any:
    return bearing_sd(
        sonar["signal to noise"],
        elements=sonar["elements"],
        spacing=study.assumed["bound_spacing"] / sonar["wavelength"],
        bearing=sonar["bearing"],
        samples=sonar["record"],
    )


def _frequency_sd(study: Study, sonar: dict[str, Any]) -> Any:
    return frequency_sd(
        sonar["signal to noise"],
        samples=sonar["record"],
        rate_hz=study.assumed["bound_rate_hz"],
        elements=sonar["elements"],
    )


def _values(study: Study) -> dict[str, dict[str, float]]:
    """Both bounds of every array."""
    found: dict[str, dict[str, float]] = {}
    for elements in study.assumed["bound_elements"]:
        sonar = _sonar(study) | {"elements": elements}
        found[f"{elements} elements"] = {
            "bearing, °": float(np.degrees(_bearing_sd(study, sonar))),
            f"bearing at {np.degrees(_SLANT):.0f}°, °": float(
                np.degrees(_bearing_sd(study, sonar | {"bearing": _SLANT}))
            ),
            "frequency, Hz": float(_frequency_sd(study, sonar)),
        }
    return found


def _doubled(
    study: Study, bound: Callable[[Study, dict[str, Any]], Any], *names: str
) -> dict[str, float]:
    """A bound with one number of the sonar doubled, over that without."""
    sonar = _sonar(study)
    usual = bound(study, sonar)
    return {
        f"{_TWICE}{name}": float(bound(study, sonar | {name: 2.0 * sonar[name]}) / usual)
        for name in names
    }


def _bearing(study: Study) -> Claim:
    names = ("signal to noise", "wavelength", "elements")
    sonar = _sonar(study)
    turned = _bearing_sd(study, sonar | {"bearing": _SLANT}) / _bearing_sd(study, sonar)
    ours = _doubled(study, _bearing_sd, *names) | {_FARTHER: float(turned)}
    snr, wavelength, length, slant = ours.values()
    stated = "smaller for more signal and a longer array, larger for longer waves and bearings"
    true = snr < 1.0 and length < 1.0 and wavelength > 1.0 and slant > 1.0
    return part("BO-M11", "bearing", stated, ours, said(true))


def _frequency(study: Study) -> Claim:
    ours = _doubled(study, _frequency_sd, "signal to noise", "record")
    true = all(value < 1.0 for value in ours.values())
    return part(
        "BO-M11", "frequency", "smaller for more signal and a longer record", ours, said(true)
    )


def _significance(study: Study) -> Claim:
    """Bias over standard deviation where bearing and frequency are as good as their bounds."""
    arrays, printed = study.assumed["bound_elements"], study.printed("BO-S07")
    speeds = sorted({printed["speed_ftps"], *study.assumed["significance_speeds_ftps"]})
    found = np.array([[_at_bounds(study, v, m) for m in sorted(arrays)] for v in speeds])
    true = np.all(np.diff(found, axis=0) > 0.0) and np.all(np.diff(found, axis=1) < 0.0)
    ours = {
        f"{v:g} ft/s": {
            f"{m} elements": float(s) for m, s in zip(sorted(arrays), each, strict=True)
        }
        for v, each in zip(speeds, found, strict=True)
    }
    return part(
        "BO-M11", "significance", "most for fast platforms with small arrays", ours, said(true)
    )


def _at_bounds(study: Study, speed: float, elements: int) -> float:
    sonar, printed = _sonar(study) | {"elements": elements}, study.printed("BO-S07")
    seen = doppler.echo(
        printed,
        study.assumed,
        np.degrees(_bearing_sd(study, sonar)),
        speed=speed,
        sigma_hz=_frequency_sd(study, sonar),
    )
    return float(doppler.significance(seen, np.radians(printed["bearing_deg"])))

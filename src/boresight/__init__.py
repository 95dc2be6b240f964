"""boresight: track targets from real sensors, find what is wrong with the sensor, and say so.

    import boresight as bs

    radar = bs.Radar(range_m=30, azimuth_deg=1.5, elevation_deg=1.5)
    motion = bs.ConstantVelocity(accel_mps2=0.5, dims=3)
    truth, plots = bs.simulate("kashyap-set-2", radar, runs=1000, seed=7)
    estimate = bs.run("mekf", motion, radar, plots)
    print(bs.rmse(estimate, truth), bs.anees(estimate, truth))

Names are loaded when they are first used, so importing boresight costs nothing.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_WHERE = {
    "errors": ["BoresightError", "DataError", "Status", "UsageError"],
    "maths.gaussian": ["Gaussian"],
    "maths.frames": ["Site"],
    "models.motion": [
        "ConstantAcceleration",
        "ConstantVelocity",
        "CoordinatedTurn",
        "SphericalUnitRate",
        "Static",
        "WithHeightOffset",
    ],
    "models.coordinates": ["CartesianPlots", "PositionSensor"],
    "models.error_model": ["ErrorModel"],
    "models.polar": ["Given"],
    "models.sensors": ["Bearings", "ConicalBearings", "Pose", "Radar"],
    "models.atmosphere": ["EffectiveEarth", "ExponentialAtmosphere", "NoAtmosphere"],
    "catalogue": ["cite"],
    "target_motion.result": ["Criteria"],
    "filters.method": ["Filter", "Outside"],
    "filters.posterior": ["Posterior"],
    "filters.own_doppler": ["track_range_rate"],
    "filters.particle": ["bearing_particles", "particle_filter"],
    "experiments.scenario": ["Scenario"],
    "experiments.simulate": ["simulate"],
    "experiments.metrics": ["anees", "rmse"],
    "experiments.sets": ["gospa", "ospa"],
    "experiments.reproduce": ["reproduce"],
    "experiments.worlds": ["random_draws", "recorded", "waypoints"],
    "experiments.spreads": ["Annulus", "Normal", "Uniform"],
    "laboratory.study": ["Contender", "Limits", "Setting", "Study"],
    "interfaces.converting": ["convert"],
    "interfaces.error_models": ["error_model"],
    "calibration.correcting": ["correct"],
    "interfaces.calibration": ["calibrate", "read_calibration", "write_calibration"],
    "interfaces.contacts": ["tma"],
    "interfaces.studies": ["compare"],
    "interfaces.reading": ["read"],
    "interfaces.python": ["inspect", "report", "run", "smooth", "stream", "track"],
}
_MODULES = ("maths", "testing")  # what a user's own filter is written with, and held to
_NAMES = {name: module for module, names in _WHERE.items() for name in names}
__all__ = sorted([*_NAMES, *_MODULES, "__version__"])  # noqa: PLE0605 - built from the one table above


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used (PEP 562)."""
    if name in _MODULES:
        return import_module(f"boresight.{name}")
    if name not in _NAMES:
        raise AttributeError(f"module 'boresight' has no attribute {name!r}")
    value = getattr(import_module(f"boresight.{_NAMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Public names, loaded or not."""
    return __all__

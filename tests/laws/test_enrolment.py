"""Nothing new goes unjudged: what the package offers and what the laws name must be the same."""

import dataclasses
import inspect

from boresight import catalogue
from boresight.models import coordinates, motion, sensors
from boresight.models.components import FORMULAS
from laws.enrolled import BEARING_WORLDS, BY_EAR, FILTERS, LINEAR_WORLDS, MOTIONS, POLAR_WORLDS


def test_every_filter_of_the_catalogue_is_enrolled():
    assert {entry.name for entry in (*FILTERS, *BY_EAR)} == set(catalogue.names())


def test_every_motion_is_enrolled():
    offered = {
        kind
        for _, kind in inspect.getmembers(motion, dataclasses.is_dataclass)
        if kind.__module__ == motion.__name__
    }
    assert {type(m) for m in MOTIONS} == offered


def test_every_component_and_sensor_is_enrolled():
    worlds = (*POLAR_WORLDS, *LINEAR_WORLDS, *BEARING_WORLDS)
    measured = {name for world in worlds for name in world.sensor.names}
    fields = {
        f.name.replace("_deg", "_rad")
        for kind in (sensors.Radar, coordinates.PositionSensor)
        for f in dataclasses.fields(kind)
        if f.name not in ("pose", "site", "atmosphere", "range_rate_correlation")
    }
    assert measured == fields
    assert set(FORMULAS) <= measured

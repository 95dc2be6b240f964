"""A contact: the bearings of one target, and where own ship was when each was heard."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from boresight.maths.frames import Site
from boresight.models.sensors import Pose, Radar

Array = Any


@dataclass(frozen=True, eq=False, kw_only=True)
class Contact:
    """Bearings of one contact, in the order of time, on a plane with x = North and y = East.

    Attributes:
        name: the file's track, or the file's name.
        time_s: (steps,), increasing.
        bearing_rad: (steps,), true, clockwise from North; NaN where only a cone was heard.
        cone_rad: (steps,), angle off the array's axis, 0 ahead to pi astern; NaN where a true
            bearing was heard.
        sigma_rad: (steps,), standard deviation of whichever it is.
        position_m: (steps, 2), the receiver's North and East.
        velocity_mps: (steps, 2), the receiver's.
        axis_rad: (steps,), true direction of the array's axis, ahead; NaN where nobody knows.
        site: place of the plane's origin; None where positions were given in metres.
        remarks: what a reader of the file should know.
    """

    name: str
    time_s: Array
    bearing_rad: Array
    cone_rad: Array
    sigma_rad: Array
    position_m: Array
    velocity_mps: Array
    axis_rad: Array
    site: Site | None = None
    remarks: tuple[str, ...] = ()

    @property
    def is_conical(self) -> bool:
        """Whether some bearings do not tell one side from the other."""
        return bool(np.isfinite(self.cone_rad).any())

    @cached_property
    def sensor(self) -> Radar:
        """The sensor, moving with own ship: what the contact's `plots` are of.

        A cone's pose has the array's axis as its x axis; azimuths are then measured from that axis
        too, which `plots` takes into account.
        """
        steps = len(self.time_s)
        turn = np.zeros((1, steps, 3, 3))
        axis = np.where(np.isnan(self.axis_rad), 0.0, self.axis_rad) if self.is_conical else 0.0
        turn[0] = np.moveaxis(_axes(np.broadcast_to(axis, steps)), -1, 0)
        up = np.zeros((steps, 1))
        pose = Pose(
            position_m=np.hstack([self.position_m, up])[None],
            rotation=turn if self.is_conical else np.eye(3),
            velocity_mps=np.hstack([self.velocity_mps, up])[None],
        )
        sigma = np.degrees(self.sigma_rad)[None]
        heard = np.isfinite(self.bearing_rad).any()
        return Radar(
            azimuth_deg=sigma if heard else None,
            cone_deg=sigma if self.is_conical else None,
            pose=pose,
        )

    @cached_property
    def plots(self) -> Array:
        """(1, steps, k): what `sensor` measured, radians, NaN where it did not."""
        axis = np.nan_to_num(self.axis_rad) if self.is_conical else 0.0
        columns = {"azimuth_rad": self.bearing_rad - axis, "cone_rad": self.cone_rad}
        return np.stack([columns[name] for name in self.sensor.names], axis=-1)[None]

    @cached_property
    def dt(self) -> Array:
        """(1, steps): seconds before each bearing; 0 before the first."""
        return np.diff(self.time_s, prepend=self.time_s[0])[None]


def _axes(axis: Array) -> Array:
    """(3, 3, steps): rows are the axes of an array that points there: ahead, starboard, up."""
    c, s, zero, one = np.cos(axis), np.sin(axis), 0.0 * axis, 1.0 + 0.0 * axis
    return np.array([[c, s, zero], [-s, c, zero], [zero, zero, one]])

"""How a track begins: given, drawn at random, or made from its first one or two plots.

All functions take many targets at once (lanes first). A start has the same state order as the
motion: positions, velocities, and whatever follows, which begins at zero with a stated spread.
"""

from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.maths import Gaussian
from boresight.models.conversions import convert
from boresight.models.coordinates import CartesianPlots, PositionSensor
from boresight.models.motion import Motion
from boresight.models.sensors import Radar, Sensor

Array = Any
SPEED_MPS = 300.0  # spread of an unknown velocity, each axis: covers airliners
CONTACT_MPS = 11.0  # that of a contact at sea: 21 knots
SPREADS = {  # of further states, by the unit that ends their name
    "mps2": 10.0,  # 1 g
    "radps": 0.1,  # twice the standard rate of turn
    "m": 300.0,  # what weather makes of a pressure altitude
}


def random_draw(prior: Gaussian, generator: np.random.Generator, lanes: int) -> Gaussian:
    """Means drawn from the prior, one a lane, each with the prior's covariance.

    Args:
        prior: mean (n,) or (lanes, n), cov (n, n); the cov may be singular.
        generator: source of normals.
        lanes: number of lanes.
    """
    values, vectors = np.linalg.eigh(np.asarray(prior.cov, dtype=float))
    root = vectors * np.sqrt(np.clip(values, 0.0, None))
    normals = generator.standard_normal((lanes, len(values)))
    return Gaussian(np.asarray(prior.mean) + normals @ root.T, prior.cov)


def one_plot(
    z: Array,
    motion: Motion,
    sensor: Sensor,
    *,
    speed_mps: float = SPEED_MPS,
    conversion: str = "conventional",
) -> Gaussian:
    """Position from one plot, velocity unknown. Paper: kashyap (3), with R = J R J'.

    Args:
        z: (lanes, k) plots, SI units and radians.
        motion: state layout.
        sensor: a radar with range, azimuth and, in three dimensions, elevation; or coordinates.
        speed_mps: standard deviation of each velocity.
        conversion: of polar plots, with the covariance that it has given the plot.

    Returns:
        mean (lanes, n), cov (lanes, n, n); NaN where the plot lacks a component that is needed.
    """
    position, spread = locate(z, motion, sensor, conversion)
    n, dims = len(motion.names), motion.dims
    mean = np.zeros((len(position), n))
    cov = np.zeros((len(position), n, n))
    mean[:, :dims], cov[:, :dims, :dims] = position, spread
    for i in range(dims, n):
        unit = motion.names[i].rsplit("_", 1)[-1]
        cov[:, i, i] = (speed_mps if i < 2 * dims else SPREADS[unit]) ** 2
    return Gaussian(mean, cov)


def on_bearing(
    z: Array,
    motion: Motion,
    sensor: Radar,
    range_m: Array,
    range_sd_m: float,
    *,
    speed_mps: float,
) -> Gaussian:
    """On the bearing of a first plot, at a range that is given: its spread turned to the bearing.

    [pradeep] leaves the start open; across the bearing the spread is the range times the angle's.

    Args:
        z: (lanes, k) plots, radians.
        motion: state layout, in the plane.
        sensor: bearings, true or off an axis (then the side towards positive y of its pose).
        range_m: mean of the range, m: one, or one a lane.
        range_sd_m: standard deviation of the range, m.
        speed_mps: standard deviation of each velocity.

    Returns:
        mean (lanes, n), cov (lanes, n, n); NaN where no bearing was heard.
    """
    z = np.atleast_2d(np.asarray(z, dtype=float))
    bearing, sigma = np.full(len(z), np.nan), np.zeros(len(z))
    for name in ("cone_rad", "azimuth_rad"):  # where both are heard, the one without two sides
        if name in sensor.names:
            heard = z[:, sensor.names.index(name)]
            spread = np.radians(_first(getattr(sensor, name.replace("_rad", "_deg"))))
            sigma = np.where(np.isnan(heard), sigma, spread)
            bearing = np.where(np.isnan(heard), bearing, heard)
    position, J = from_polar(np.stack([np.full(len(z), range_m), bearing], axis=-1))
    polar = np.zeros((len(z), 2, 2))
    polar[:, 0, 0], polar[:, 1, 1] = range_sd_m**2, sigma**2
    n, d = len(motion.names), motion.dims
    mean, cov = np.zeros((len(z), n)), np.zeros((len(z), n, n))
    mean[:, :2], cov[:, :2, :2] = _in_track_frame(position, J @ polar @ J.mT, sensor)
    for i in range(d, n):
        unit = motion.names[i].rsplit("_", 1)[-1]
        cov[:, i, i] = (speed_mps if i < 2 * d else SPREADS[unit]) ** 2
    return Gaussian(mean, cov)


def two_plots(first: Array, second: Array, dt: Array, motion: Motion, sensor: Sensor) -> Gaussian:
    """Position from the second plot, velocity from the difference (two-point differencing).

    Args:
        first: (lanes, k) earlier plots.
        second: (lanes, k) later plots.
        dt: seconds between them, a number or (lanes,).
        motion: state layout, as in `one_plot`.
        sensor: as in `one_plot`.
    """
    start = one_plot(second, motion, sensor)
    before, spread = locate(first, motion, sensor)
    after, later = locate(second, motion, sensor)
    d, t = motion.dims, np.broadcast_to(np.asarray(dt, dtype=float), len(before))[:, None]
    mean, cov = start
    mean[:, d : 2 * d] = (after - before) / t
    cov[:, d : 2 * d, d : 2 * d] = (spread + later) / t[..., None] ** 2
    cov[:, :d, d : 2 * d] = cov[:, d : 2 * d, :d] = later / t[..., None]
    steps, which = np.unique(t[:, 0], return_inverse=True)
    Q = np.stack([motion.noise(float(step)) for step in steps])[which]
    x, v, T = slice(0, d), slice(d, 2 * d), t[..., None]
    # What the motion did in between: (noise of the velocity) - (noise of the position) / T.
    cov[:, v, v] += Q[:, v, v] - (Q[:, x, v] + Q[:, v, x]) / T + Q[:, x, x] / T**2
    return Gaussian(mean, cov)


def locate(
    z: Array, motion: Motion, sensor: Sensor, conversion: str = "conventional"
) -> tuple[Array, Array]:
    """Position (lanes, dims) of each plot in the track frame, and its covariance."""
    z = np.atleast_2d(np.asarray(z, dtype=float))
    if isinstance(sensor, PositionSensor):
        if len(sensor.names) < motion.dims:
            raise UsageError(
                f"a plot of {', '.join(sensor.names)} does not say where the target is",
                next_step=_GIVE,
            )
        sigmas = [np.broadcast_to(_first(getattr(sensor, n)), len(z)) for n in sensor.names]
        variances = np.stack(sigmas, axis=-1)[:, : motion.dims] ** 2
        return z[:, : motion.dims], variances[:, :, None] * np.eye(motion.dims)
    if isinstance(sensor, CartesianPlots):
        return z, _first_cov(sensor.cov, len(z))
    if not isinstance(sensor, Radar):
        raise UsageError(f"no start from one plot of a {type(sensor).__name__}", next_step=_GIVE)
    needed = ("range_m", "azimuth_rad", "elevation_rad")[: motion.dims]
    lacking = [name for name in needed if name not in sensor.names]
    if lacking:
        raise UsageError(
            f"a plot without {lacking[0]} does not say where the target is",
            next_step=f"{_GIVE}, or use rp-ekf" if _BEARINGS & set(sensor.names) else _GIVE,
        )
    columns = [sensor.names.index(name) for name in needed]
    spreads = [_first(getattr(sensor, name.replace("_rad", "_deg"))) for name in needed]
    spreads[1:] = [np.radians(s) for s in spreads[1:]]
    sigma = np.stack([np.broadcast_to(s, len(z)) for s in spreads])
    found = convert(conversion, z[:, columns].T, sigma)
    position, cov = found.mean.T, np.moveaxis(found.cov, -1, 0)
    return _in_track_frame(position, cov, sensor)


def _in_track_frame(position: Array, cov: Array, sensor: Radar) -> tuple[Array, Array]:
    """Positions (lanes, d) that a sensor sees, and their covariances, where the sensor stands."""
    if sensor.pose is None:
        return position, cov
    d = position.shape[-1]
    turn = np.asarray(sensor.pose.rotation, dtype=float).reshape(-1, 3, 3)[0, :d, :d]
    origin = np.asarray(sensor.pose.position_m, dtype=float).reshape(-1, 3)[0, :d]
    return position @ turn + origin, turn.T @ cov @ turn


_GIVE = "give the start: start=Gaussian(mean, cov)"
_BEARINGS = {"azimuth_rad", "cone_rad"}  # what a bank of ranges begins on


def _first(sigma: Any) -> Any:
    """A noise at the first step: a number, or one a lane."""
    array = np.asarray(sigma, dtype=float)
    return array[:, 0] if array.ndim == 2 else array


def _first_cov(cov: Array, lanes: int) -> Array:
    """Covariances (lanes, d, d) at the first step, of (d, d) or (lanes, steps, d, d)."""
    array = cov[:, 0] if cov.ndim == 4 else cov
    return np.broadcast_to(array, (lanes, *array.shape[-2:]))


def from_polar(polar: Array) -> tuple[Array, Array]:
    """Cartesian position of (range, azimuth[, elevation]) and its Jacobian.

    Args:
        polar: (lanes, 2 or 3), m and rad, azimuth from x towards y.

    Returns:
        (lanes, dims) and (lanes, dims, dims). Paper: kashyap (3).
    """
    r, az = polar[:, 0], polar[:, 1]
    el = polar[:, 2] if polar.shape[1] == 3 else np.zeros_like(az)
    ca, sa, ce, se = np.cos(az), np.sin(az), np.cos(el), np.sin(el)
    unit = np.stack([ca * ce, sa * ce, se], axis=-1)
    across = np.stack([-sa * ce, ca * ce, 0 * az], axis=-1)
    upward = np.stack([-ca * se, -sa * se, ce], axis=-1)
    J = np.stack([unit, r[:, None] * across, r[:, None] * upward], axis=-1)
    d = polar.shape[1]
    return (r[:, None] * unit)[:, :d], J[:, :d, :d]

"""How targets move. A motion is frozen data with two formulas: `move` and `noise`.

State order: all positions, then all velocities, then what the motion adds. Units are SI unless a
motion says otherwise. `move(state, dt)` takes and gives (n,); `noise(dt)` is the covariance (n, n)
of what `move` leaves out. Both run on floats and on symbols.
"""

from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from boresight.errors import UsageError
from boresight.maths import select
from boresight.models.kinematics import check_motion, each_axis, state_names, taylor

Array = Any
OFFSET = "height_offset_m"  # pressure altitude minus height above the ellipsoid


class Motion(Protocol):
    """What a filter needs to know of a motion."""

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each state element, with its unit."""

    @property
    def dims(self) -> int:
        """Number of position coordinates: 2 (x, y) or 3 (x, y, z)."""

    def move(self, state: Array, dt: Any) -> Array:
        """State (n,) after dt seconds."""

    def noise(self, dt: Any) -> Array:
        """Covariance (n, n) of the motion's uncertainty over dt seconds."""


@dataclass(frozen=True, kw_only=True)
class ConstantVelocity:
    """Straight flight disturbed by white acceleration; state [positions, velocities].

    Attributes:
        accel_mps2: standard deviation of the acceleration, m/s². `kashyap`'s Q = 0.25 is the
            acceleration variance, so 0.5 here (erratum K7).
        dims: 2 or 3.
        discretisation: `discrete`: one acceleration a step, G Q G' with G = [T²/2; T] (the reading
            of erratum K7). `continuous`: white acceleration of density accel_mps2² (m²/s³).
            `printed`: K7 as printed, six independent noises, so no position-velocity correlation.
    """

    accel_mps2: float
    dims: int = 3
    discretisation: Literal["discrete", "continuous", "printed"] = "discrete"

    def __post_init__(self) -> None:
        check_motion(self)

    @property
    def names(self) -> tuple[str, ...]:
        """[x_m, y_m, (z_m,) vx_mps, ...]."""
        return state_names(self.dims, "{}_m", "v{}_mps")

    def move(self, state: Array, dt: Any) -> Array:
        """Positions advance by velocity times dt."""
        return taylor(state, dt, self.dims)

    def noise(self, dt: Any) -> Array:
        """Covariance (2 dims, 2 dims)."""
        q = self.accel_mps2 * self.accel_mps2
        if self.discretisation == "continuous":
            block = [[q * dt**3 / 3, q * dt**2 / 2], [q * dt**2 / 2, q * dt]]
        elif self.discretisation == "printed":
            block = [[q * dt**4 / 4, q * 0.0], [q * 0.0, q * dt**2]]
        else:
            block = [[q * dt**4 / 4, q * dt**3 / 2], [q * dt**3 / 2, q * dt**2]]
        return each_axis(block, self.dims)


@dataclass(frozen=True, kw_only=True)
class ConstantAcceleration:
    """Constant acceleration disturbed by white jerk; state [positions, velocities, accelerations].

    Attributes:
        jerk_mps3: `continuous`: white jerk of density jerk_mps3² (m²/s⁵). `discrete`: one
            acceleration increment a step, of standard deviation jerk_mps3 times dt.
        dims: 2 or 3.
        discretisation: as above.
    """

    jerk_mps3: float
    dims: int = 3
    discretisation: Literal["discrete", "continuous"] = "continuous"

    def __post_init__(self) -> None:
        check_motion(self)

    @property
    def names(self) -> tuple[str, ...]:
        """[x_m, ..., vx_mps, ..., ax_mps2, ...]."""
        return state_names(self.dims, "{}_m", "v{}_mps", "a{}_mps2")

    def move(self, state: Array, dt: Any) -> Array:
        """Taylor series to the acceleration."""
        return taylor(state, dt, self.dims)

    def noise(self, dt: Any) -> Array:
        """Covariance (3 dims, 3 dims)."""
        q = self.jerk_mps3 * self.jerk_mps3
        if self.discretisation == "discrete":
            gain = [dt**3 / 2, dt**2, dt]
            block = [[q * (a * b) for b in gain] for a in gain]
        else:
            block = [
                [q * dt**5 / 20, q * dt**4 / 8, q * dt**3 / 6],
                [q * dt**4 / 8, q * dt**3 / 3, q * dt**2 / 2],
                [q * dt**3 / 6, q * dt**2 / 2, q * dt],
            ]
        return each_axis(block, self.dims)


@dataclass(frozen=True, kw_only=True)
class CoordinatedTurn:
    """Flight at constant speed and turn rate in the plane; state [x, y, vx, vy, turn rate].

    Attributes:
        accel_mps2: standard deviation of the acceleration, one a step, m/s².
        turn_accel_degps2: standard deviation of the change of turn rate, one a step, deg/s².
    """

    accel_mps2: float
    turn_accel_degps2: float

    def __post_init__(self) -> None:
        check_motion(self)

    @property
    def dims(self) -> int:
        """Planar."""
        return 2

    @property
    def names(self) -> tuple[str, ...]:
        """Turn rate in rad/s, positive from x to y."""
        return ("x_m", "y_m", "vx_mps", "vy_mps", "turn_radps")

    def move(self, state: Array, dt: Any) -> Array:
        """Exact arc: its chord, turned by half the angle.

        The chord's length is speed times sin(h)/h, h half the angle; below 1e-4 rad by its series,
        so that straight flight is regular. Nothing cancels, in the value or in its derivative.
        """
        x, y, vx, vy, w = state
        half = w * dt / 2.0
        small = abs(half) < 1e-4
        safe = select(small, 1.0, half)
        chord = select(small, 1.0 - half * half / 6.0, np.sin(safe) / safe) * dt
        s, c = np.sin(half), np.cos(half)
        sin, cos = 2.0 * s * c, 1.0 - 2.0 * s * s
        return np.array(
            [
                x + chord * (c * vx - s * vy),
                y + chord * (s * vx + c * vy),
                cos * vx - sin * vy,
                sin * vx + cos * vy,
                w,
            ]
        )

    def noise(self, dt: Any) -> Array:
        """Covariance (5, 5)."""
        q = self.accel_mps2 * self.accel_mps2
        turn = self.turn_accel_degps2 * (np.pi / 180.0) * dt
        zero = q * 0.0
        a, b, c, d = q * dt**4 / 4, q * dt**3 / 2, q * dt**2, turn * turn
        return np.array(
            [
                [a, zero, b, zero, zero],
                [zero, a, zero, b, zero],
                [b, zero, c, zero, zero],
                [zero, b, zero, c, zero],
                [zero, zero, zero, zero, d],
            ]
        )


@dataclass(frozen=True, kw_only=True)
class Static:
    """A target that stays where it is, but for a random walk; state [positions].

    Attributes:
        drift_m_per_sqrt_s: standard deviation of the walk after one second, m.
        dims: 2 or 3.
    """

    drift_m_per_sqrt_s: float = 0.0
    dims: int = 3

    def __post_init__(self) -> None:
        check_motion(self)

    @property
    def names(self) -> tuple[str, ...]:
        """[x_m, y_m, (z_m)]."""
        return state_names(self.dims, "{}_m")

    def move(self, state: Array, dt: Any) -> Array:
        """Nothing moves."""
        del dt
        return state

    def noise(self, dt: Any) -> Array:
        """Covariance (dims, dims)."""
        q = self.drift_m_per_sqrt_s * self.drift_m_per_sqrt_s
        return each_axis([[q * dt]], self.dims)


@dataclass(frozen=True, kw_only=True)
class WithHeightOffset:
    """Any motion in three dimensions, with the offset of pressure altitude as its last state.

    Attributes:
        inner: how the target moves.
        drift_m_per_sqrt_s: random walk of the offset, m after one second.
    """

    inner: ConstantVelocity | ConstantAcceleration
    drift_m_per_sqrt_s: float

    def __post_init__(self) -> None:
        if not isinstance(self.inner, ConstantVelocity | ConstantAcceleration) or self.dims != 3:
            raise UsageError(
                f"inner={self.inner!r} has no height to be offset",
                next_step="use ConstantVelocity or ConstantAcceleration with dims=3",
            )
        check_motion(self)

    @property
    def dims(self) -> int:
        """Those of the inner motion."""
        return self.inner.dims

    @property
    def names(self) -> tuple[str, ...]:
        """States of the inner motion, then `height_offset_m`."""
        return (*self.inner.names, OFFSET)

    def move(self, state: Array, dt: Any) -> Array:
        """The offset stays."""
        return np.concatenate([self.inner.move(state[:-1], dt), state[-1:]])

    def noise(self, dt: Any) -> Array:
        """Block diagonal: the inner motion's noise, and the walk."""
        inner = self.inner.noise(dt)
        walk = self.drift_m_per_sqrt_s * self.drift_m_per_sqrt_s * dt
        column = np.array([[walk * 0.0]] * len(inner))
        return np.block([[inner, column], [column.T, np.array([[walk]])]])


@dataclass(frozen=True, kw_only=True)
class SphericalUnitRate:
    """`aditya`'s motion: range, azimuth and elevation all grow at unit rate.

    Paper: aditya, (7) to (15), as corrected by errata A1, A2 and A3: (10) to (12) are the
    derivatives of position for unit rates, so they are integrated over dt, not iterated.
    State [x, y, z, vx, vy, vz], in the paper's units: positions km, velocities m/s.
    The velocities never feed the positions, so they cannot be observed (erratum A6).

    Attributes:
        position_noise: standard deviation added to each position at each step, km.
        velocity_noise: standard deviation added to each velocity at each step, m/s.
    """

    position_noise: float
    velocity_noise: float

    def __post_init__(self) -> None:
        check_motion(self)

    @property
    def dims(self) -> int:
        """Three."""
        return 3

    @property
    def names(self) -> tuple[str, ...]:
        """Positions km, velocities m/s."""
        return ("x_km", "y_km", "z_km", "vx_mps", "vy_mps", "vz_mps")

    def move(self, state: Array, dt: Any) -> Array:
        """One Euler step (erratum A2)."""
        x, y, z = state[:3]
        ground = np.sqrt(x * x + y * y)
        r = np.sqrt(x * x + y * y + z * z)
        rates = [
            x / r - y - x * z / ground,  # (10)
            y / r + x - y * z / ground,  # (11), first term by erratum A1
            z / r + ground,  # (12)
            -2 * y / r - 2 * x * z / (r * ground) - 2 * x + 2 * y * z / ground,  # (13)
            2 * x / r - 2 * y * z / (r * ground) - 2 * y - 2 * x * z / ground,  # (14), erratum A3
            2 * ground / r - z,  # (15)
        ]
        return np.array([s + dt * rate for s, rate in zip(state, rates, strict=True)])

    def noise(self, dt: Any) -> Array:
        """Covariance (6, 6); the paper's Q is per step, whatever dt."""
        del dt
        p, v = self.position_noise * self.position_noise, self.velocity_noise * self.velocity_noise
        zero = p * 0.0
        diagonal = [p, p, p, v, v, v]
        return np.array([[diagonal[i] if i == j else zero for j in range(6)] for i in range(6)])

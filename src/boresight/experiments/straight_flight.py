"""Samples of one straight flight, given its plots: an integral in three dimensions.

With u = (range, radial speed, transverse speed) at the first scan, the line of flight turned back
by the first azimuth is w = (r + t vr) + i t vt in the complex plane: ranges are |w|, azimuths the
first one plus arg w. Given u the first azimuth is thus normal, and is integrated out; so is the
rotation by which it turns mean and covariance. What is left is sampled: the transverse speed from
the Laplace approximation of its marginal density, on a grid; radial speed and range from a
Student t around their mode given the transverse speed.

[tierney1986] L. Tierney and J. B. Kadane, "Accurate Approximations for Posterior Moments and
Marginal Densities".
Differs from it: the approximation only says where the points are. Importance weights make the
answer exact but for the Monte Carlo error, which the effective sample size tells.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np

from boresight.lanes import (
    Kernel,
    Leaf,
    Rate,
    Scalar,
    States,
    Symmetric,
    Vector,
    jacobian,
    make_kernel,
    pack_states,
    trace,
)
from boresight.maths import mirror

Array = Any
Flat = Literal["polar", "cartesian"]
_NODES = 65  # of the grid of transverse speeds
_WIDEST = 7.0  # speed_mps that the first grid reaches
_DEEPEST = 20.0  # of the log density below its peak: what lies lower is left out (2e-9)
_FLOOR = 1e-3  # of the peak: the least density of proposed speeds, lest a weight run away
_TAIL = 8.0  # degrees of freedom of the Student t
_FREE = [0, 1, 3]  # of (r, vr, vt, azimuth): what is sought given vt
_ORDER = [0, 2, 1, 3]  # x, vx, y, vy to x, y, vx, vy


class Prior(NamedTuple):
    """What is known before the plots, and how well they measure.

    Attributes:
        sigma: (2,) standard deviations of range and azimuth, m and rad.
        speed_mps: standard deviation of each velocity.
        flat: coordinates in which the density of the first position is constant.
    """

    sigma: Array
    speed_mps: float
    flat: Flat


@dataclass(frozen=True, eq=False)
class Samples:
    """Of one run.

    Attributes:
        prior: what is known beforehand.
        t: (scans,) seconds since the first plot.
        z: (scans, 2) range and azimuth, the azimuth unwrapped.
    """

    prior: Prior
    t: Array
    z: Array

    def moments(self, cube: Array) -> tuple[Array, Array, float]:
        """Mean (4,) and cov (4, 4) at the last scan, and the effective sample size.

        Args:
            cube: (points, 3) of the unit cube, evenly spread.
        """
        u, log_density = self._propose(cube)
        log, azimuth = self._log_posterior(u)
        weight = np.exp(log - log_density - np.max(log - log_density))
        weight /= np.sum(weight)
        variance = self.prior.sigma[1] ** 2 / len(self.t)
        speed = u[:, 1] + 1j * u[:, 2]
        w = np.stack([u[:, 0] + self.t[-1] * speed, speed])  # turned back by the first azimuth
        once = weight * np.exp(1j * azimuth - variance / 2)  # E exp(i azimuth) given u
        twice = weight * np.exp(2j * azimuth - 2 * variance)
        mean = w @ once
        A = (w * twice) @ w.T - np.outer(mean, mean)
        B = (w * weight) @ w.conj().T - np.outer(mean, mean.conj())
        cov = np.block([[(B + A).real, (A - B).imag], [(A + B).imag, (B - A).real]]) / 2
        state = np.concatenate([mean.real, mean.imag])
        return state[_ORDER], cov[np.ix_(_ORDER, _ORDER)], 1 / float(np.sum(np.square(weight)))

    def _propose(self, cube: Array) -> tuple[Array, Array]:
        """Points u (points, 3) from those of the unit cube, and their log density."""
        nodes, density, mode, root = self._profile()
        mass = np.diff(nodes) * (density[1:] + density[:-1]) / 2
        across = np.interp(cube[:, 0], np.append(0.0, np.cumsum(mass) / np.sum(mass)), nodes)
        cell = np.clip(np.searchsorted(nodes, across) - 1, 0, len(mass) - 1)
        table = np.column_stack([mode, root[:, [0, 1, 1], [0, 0, 1]]])
        r, vr, a, b, c = (np.interp(across, nodes, column) for column in table.T)
        # A bivariate t in closed form: the squared radius has the tail (1 + s/nu)^(-nu/2).
        square = _TAIL * ((1.0 - cube[:, 1]) ** (-2.0 / _TAIL) - 1.0)
        x, y = np.sqrt(square) * np.array([np.cos(turn := 2 * np.pi * cube[:, 2]), np.sin(turn)])
        u = np.stack([r + a * x, vr + b * x + c * y, across], axis=-1)
        log_t = -np.log(a * c) - (1.0 + _TAIL / 2) * np.log1p(square / _TAIL)
        return u, log_t + np.log(mass / np.diff(nodes))[cell]

    def _profile(self) -> tuple[Array, Array, Array, Array]:
        """Nodes of the transverse speed, its density there, and (r, vr) given it: mode and root.

        The grid closes in on where the density is, twice.
        """
        nodes = _WIDEST * self.prior.speed_mps * np.linspace(-1.0, 1.0, _NODES)
        guess = np.broadcast_to([self.z[0, 0], 0.0], (_NODES, 2))
        for rounds in (8, 3, 3):
            mode, root = self._given_transverse(nodes, guess, rounds)
            log = self._log_posterior(np.column_stack([mode, nodes]))[0]
            log += np.log(root[:, 0, 0] * root[:, 1, 1])
            log -= np.max(log)
            found = nodes, np.maximum(np.exp(log), _FLOOR), mode, root
            kept = np.flatnonzero(log > -_DEEPEST)
            low, high = nodes[max(kept[0] - 1, 0)], nodes[min(kept[-1] + 1, _NODES - 1)]
            nodes, coarse = np.linspace(low, high, _NODES), nodes
            guess = np.stack([np.interp(nodes, coarse, q) for q in mode.T], axis=-1)
        return found

    def _given_transverse(self, vt: Array, guess: Array, rounds: int) -> tuple[Array, Array]:
        """Mode of (r, vr) given vt, by Gauss-Newton, and the Cholesky factor of its covariance."""
        q = np.column_stack([guess, vt, np.full(len(vt), self.z[0, 1])])
        weight = np.array([0.0, self.prior.speed_mps**-2, 0.0])
        for _ in range(rounds):
            sums = self._over_scans(_normal_equations(), {"q": q, "sigma": self.prior.sigma})
            info, slope = sums["info"] + np.diag(weight), sums["slope"] - weight * q[:, _FREE]
            q[:, _FREE] += np.linalg.solve(info, slope[..., None])[..., 0]
        return q[:, :2], np.linalg.cholesky(np.linalg.inv(info)[:, :2, :2])

    def _log_posterior(self, u: Array) -> tuple[Array, Array]:
        """Log density of u (points, 3) but for a constant, and the mean of the first azimuth."""
        ranges, turn, turns = self._over_scans(_misfit(), {"u": u})["sums"].T
        azimuth = turn / len(self.t)
        square = (
            ranges / self.prior.sigma[0] ** 2 + (turns - turn * azimuth) / self.prior.sigma[1] ** 2
        )
        square += (u[:, 1] ** 2 + u[:, 2] ** 2) / self.prior.speed_mps**2
        bulk = np.log(np.abs(u[:, 0])) if self.prior.flat == "cartesian" else 0.0
        return bulk - square / 2, azimuth

    def _over_scans(self, kernel: Kernel, values: dict[str, Array]) -> States:
        """Sums over the scans, for every point; they begin at zero."""
        points, slots = len(next(iter(values.values()))), kernel.program.state
        zeros = {slot.name: np.zeros((points, *slot.leaf.shape)) for slot in slots}
        given = values | {"t": self.t, "z": self.z}
        return kernel.run(pack_states(slots, zeros), given, len(self.t))[0]


@lru_cache(maxsize=1)
def _misfit() -> Kernel:
    """Sums over scans: squared range residuals; azimuth residuals, and their squares."""

    def step(state: Any, inputs: Any) -> tuple[Any, Any]:
        (r, vr, vt), t, z = inputs["u"], inputs["t"], inputs["z"]
        x, y = r + t * vr, t * vt
        along, across = z[0] - np.sqrt(x * x + y * y), z[1] - np.arctan2(y, x)
        return {"sums": state["sums"] + np.array([along * along, across, across * across])}, {}

    return _kernel(step, {"sums": Vector(3)}, {"u": (Vector(3), Rate.LANE)})


@lru_cache(maxsize=1)
def _normal_equations() -> Kernel:
    """Sums over scans of J'J and J'residual, for what is free of q = (r, vr, vt, azimuth)."""

    def step(state: Any, inputs: Any) -> tuple[Any, Any]:
        t, sigma = inputs["t"], inputs["sigma"]

        def seen(q: Array) -> Array:
            x, y = q[0] + t * q[1], t * q[2]
            return np.array([np.sqrt(x * x + y * y), q[3] + np.arctan2(y, x)]) / sigma

        expected, J = jacobian(seen, inputs["q"])
        J = J[:, _FREE]
        slope = state["slope"] + J.T @ (inputs["z"] / sigma - expected)
        return {"info": state["info"] + mirror(J.T @ J), "slope": slope}, {}

    inputs = {"q": (Vector(4), Rate.LANE), "sigma": (Vector(2), Rate.FIXED)}
    state = {"info": Symmetric(3), "slope": Vector(3)}
    return _kernel(step, state, inputs)


def _kernel(step: Any, state: dict[str, Leaf], inputs: dict[str, tuple[Leaf, Rate]]) -> Kernel:
    plots = {"t": (Scalar(), Rate.STEP), "z": (Vector(2), Rate.STEP)}
    return make_kernel(trace(step, state=state, inputs=plots | inputs, outputs={}))

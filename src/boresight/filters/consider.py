"""Consider filtering: a filter that carries what it cannot, or must not, correct.

[schmidt1966] S. F. Schmidt, "Application of State-Space Methods to Navigation Problems";
[jazwinski1970] A. H. Jazwinski, "Stochastic Processes and Filtering Theory", section 8.4.

Systematic errors b of a radar are constant, known with a covariance, and the same for all tracks:
no track may learn them. Schmidt's filter updates the target x with b uncertain and leaves b's mean
and covariance as they were. With K = (Kx, Kb) the gain of the optimal filter of (x, b) and S the
covariance of the innovation, Joseph's form with the gain (Kx, 0) gives

    Pxx+ = Pxx - Kx S Kx',    Pxb+ = Pxb - Kx S Kb',    Pbb+ = Pbb,

the first two being those of the optimal filter. So any filter that updates a Gaussian becomes a
consider filter: let it update target and errors by a whole plot, and put back what is known of the
errors. What is put back exceeds what the optimal filter has by Kb S Kb', so the joint covariance
stays one.

Differs from them: the errors are put back once a plot, not once a component, so a filter that takes
one component after the other is that of the whole plot too. A plot sees the errors only through
what they add to it, e = E b, so the filter updates (x, e), at most three states more than its own
however many terms there are; with G' = P(x,e)^-1 P(x,e),b the change of Pxb is that of Px,(x,e)
times G'. Places are kept as of the instant at which they were measured, where a time bias does
nothing, and told as of the instant that the plot is stamped with. E is taken at the prediction. A
plot that is turned away or empty changes nothing.

Every track carries the errors on its own. Two tracks of one radar err alike, by their shares of the
same b; their covariances do not say so.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.filters.recursion import Recursion
from boresight.filters.start import SPEED_MPS
from boresight.filters.steps import State, Surprise, Updating, gaussian_layout
from boresight.lanes import Leaf, Matrix
from boresight.maths import Gaussian, jacobian, mirror, solve
from boresight.models.considered import Considered, ConsideredRadar, erring
from boresight.models.systematic import SystematicErrors, effects

Array = Any
_HAIR = 1e-10  # of a variance: keeps errors apart that are one and the same, or none
_STEEPEST = 0.1  # cosine of elevation: overhead, a plot at a given height tells no place
TIME = "time_bias_s"


@dataclass(frozen=True, kw_only=True)
class Consider:
    """A filter of a motion `Considered` that corrects the target and never the radar's errors.

    Attributes:
        inner: what updates a Gaussian.
    """

    inner: Updating

    @property
    def plain(self) -> bool:
        """What it keeps is of another instant than what it tells."""
        return False

    def start(
        self,
        z: Array,
        motion: Considered,
        sensor: ConsideredRadar,
        *,
        speed_mps: float = SPEED_MPS,
    ) -> Gaussian:
        """The inner filter's start, with what the errors did to it."""
        begun = self.inner.start(z, motion.inner, sensor.radar, speed_mps=speed_mps)
        return with_errors(begun, motion, sensor)

    def layout(self, motion: Considered, sensor: ConsideredRadar) -> dict[str, Leaf]:
        """The target when it was measured, and its covariance with the errors."""
        del sensor
        kept = gaussian_layout(motion.inner)
        return kept | {"shared": Matrix(motion.own, len(motion.terms))}

    def begin(self, start: Gaussian, motion: Considered, sensor: ConsideredRadar) -> State:
        """Target and errors, as of the instant of measurement."""
        del sensor
        own, (mean, cov) = motion.own, _later(start, motion, -1.0)
        return {"mean": mean[:own], "cov": cov[:own, :own], "shared": cov[:own, own:]}

    def predict(self, state: State, motion: Considered, sensor: ConsideredRadar, dt: Any) -> State:
        """The target by the inner filter; the errors stay."""
        del sensor
        moved = self.inner.moved(Gaussian(state["mean"], state["cov"]), motion.inner, dt)
        _, F = jacobian(lambda x: motion.inner.move(x, dt), state["mean"])
        return moved._asdict() | {"shared": F @ state["shared"]}

    def update(
        self, state: State, z: Array, motion: Considered, sensor: ConsideredRadar
    ) -> tuple[State, Surprise]:
        """By the inner filter, of the target and of what the errors add to this plot."""
        own, (mean, cov) = motion.own, _joint(state, sensor)
        z, clean = sensor.radar.independent(z, motion.inner)
        parts = list(clean)
        touched = sensor.touched([term for term in motion.terms if term != TIME])
        A = _seen(sensor.design(mean[:own], motion, touched), motion)
        for at, i in enumerate(touched, start=own):
            parts[i] = erring(parts[i], own, itemgetter(at))
        prior = Gaussian(A @ mean, _apart(A @ cov @ A.T, own, [parts[i].sigma for i in touched]))
        post = self.inner.formula(prior, z, parts, **dict(self.inner.settings))
        lost = (prior.cov - post.cov)[:own]
        return {
            "mean": post.mean[:own],
            "cov": post.cov[:own, :own],
            "shared": state["shared"] - lost @ solve(prior.cov, A @ cov[:, own:]),
        }, Surprise(*post[2:])

    def output(self, state: State, motion: Considered, sensor: ConsideredRadar) -> Gaussian:
        """Target and errors, as of the instant that the plot is stamped with."""
        mean, cov = _later(_joint(state, sensor), motion, 1.0)
        if TIME in motion.terms:
            # A speed and a time bias that are both uncertain: the variance of their product.
            at, v = motion.names.index(TIME), slice(motion.dims, 2 * motion.dims)
            cov = np.array(cov)
            cov[: motion.dims, : motion.dims] += cov[v, v] * cov[at, at]
        return Gaussian(mean, cov)


def _joint(state: State, sensor: ConsideredRadar) -> Gaussian:
    """Target and errors; the errors' mean is zero, since plots come without it."""
    mean, cov, shared = state["mean"], state["cov"], state["shared"]
    errors = mirror(sensor.cov)
    mean = np.concatenate([mean, np.zeros(len(errors))])
    return Gaussian(mean, np.block([[cov, shared], [shared.T, errors]]))


def _seen(E: Array, motion: Considered) -> Array:
    """From target and errors to target and what the errors add to a plot, but for their time."""
    own, (rows, m) = motion.own, E.shape
    timely = np.diag([0.0 if term == TIME else 1.0 for term in motion.terms])
    return np.block([[np.eye(own), np.zeros((own, m))], [np.zeros((rows, own)), E @ timely]])


def _apart(cov: Array, own: int, sigmas: Sequence[Any]) -> Array:
    """A covariance whose last elements are never one and the same, nor nothing."""
    cov = np.array(mirror(cov))
    for i, sigma in enumerate(sigmas, start=own):
        cov[i, i] = cov[i, i] + _HAIR * (cov[i, i] + sigma * sigma)
    return cov


def _later(state: Gaussian, motion: Considered, sign: float) -> Gaussian:
    """The target moved on by its time bias, or back: what is stamped t was measured before."""
    if TIME not in motion.terms:
        return state
    v, rest = state.mean[motion.dims : 2 * motion.dims], np.zeros(len(motion.names) - motion.dims)
    late = np.array([float(name == TIME) for name in motion.names])
    T = np.eye(len(motion.names)) + np.outer(np.concatenate([sign * v, rest]), late)
    return Gaussian(state.mean, mirror(T @ state.cov @ T.T))


def consider(recursion: Recursion, errors: SystematicErrors) -> Recursion:
    """The same filter, considering the uncertainty of a radar's systematic errors.

    Args:
        recursion: of a filter that updates a Gaussian in the motion's coordinates.
        errors: of the radar; their estimate has been taken out of the plots.

    Raises:
        UsageError: the filter keeps something else, or converts plots.
    """
    if not isinstance(recursion.method, Updating):
        raise UsageError(
            "this filter cannot carry the uncertainty of systematic errors",
            why="it makes positions of plots, or keeps another state than the motion's",
            next_step="use ekf, mekf, ukf, ckf or iplf",
        )
    return replace(
        recursion,
        method=Consider(inner=recursion.method),  # type: ignore[arg-type]
        motion=Considered(inner=recursion.motion, terms=errors.terms),
        sensor=ConsideredRadar(radar=recursion.sensor, cov=errors.cov),  # type: ignore[arg-type]
    )


def with_errors(start: Gaussian, motion: Considered, sensor: ConsideredRadar) -> Gaussian:
    """A start from one plot, with the share that the radar's errors have in it.

    Args:
        start: mean (lanes, n), cov (lanes, n, n) of the target, which is where the plot says.
        motion: of the target, with the terms.
        sensor: with their covariance.

    Returns:
        mean (lanes, n + m), cov (lanes, n + m, n + m).
    """
    own, dims, m, lanes = motion.own, motion.dims, len(motion.terms), len(start.mean)
    A = np.zeros((lanes, own + m, own + m)) + np.eye(own + m)
    A[:, :dims, own:] = -_displaced(start.mean[:, :dims].T, motion, sensor)
    apart = np.zeros((lanes, own + m, own + m))
    apart[:, :own, :own], apart[:, own:, own:] = start.cov, sensor.cov
    mean = np.concatenate([start.mean, np.zeros((lanes, m))], axis=1)
    return Gaussian(mean, A @ apart @ A.swapaxes(1, 2))


def _displaced(place: Array, motion: Considered, sensor: ConsideredRadar) -> Array:
    """How far a unit of each term moves what a plot takes for the place: (lanes, dims, m).

    A time bias moves a target whose velocity is unknown by nothing that is known.
    """
    p = np.zeros((3, place.shape[1]))
    p[: motion.dims] = place
    moves = _moves(p, raised="elevation_rad" in sensor.names)
    found = np.zeros((p.shape[1], motion.dims, len(motion.terms)))
    for j, term in enumerate(motion.terms):
        for channel, effect in effects(term, p, 0.0 * p).items():
            found[:, :, j] += (moves[channel] * effect)[: motion.dims].T
    return found


def _moves(p: Array, *, raised: bool) -> dict[str, Array]:
    """How places (3, lanes) move with range, azimuth and elevation, each (3, lanes).

    Where no elevation is measured the height is given, and a range moves the place level.
    """
    ground, r = np.hypot(p[0], p[1]), np.sqrt((p * p).sum(axis=0))
    nothing = np.zeros_like(r)
    along = np.stack([p[0], p[1], nothing]) / ground
    across = np.stack([-p[1], p[0], nothing])
    if raised:
        upward = -p[2] * along + np.stack([nothing, nothing, ground])
        return {"range_m": p / r, "azimuth_rad": across, "elevation_rad": upward}
    outward = along / np.maximum(ground / r, _STEEPEST)
    return {"range_m": outward, "azimuth_rad": across, "elevation_rad": 0.0 * p}

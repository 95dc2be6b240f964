"""Consider filtering: a filter that carries what it cannot, or must not, correct.

[schmidt1966] S. F. Schmidt, "Application of State-Space Methods to Navigation Problems";
[jazwinski1970] A. H. Jazwinski, "Stochastic Processes and Filtering Theory", section 8.4.

Systematic errors b of a radar are constant, known with a covariance, and the same for all tracks:
no track may learn them. Schmidt's filter updates the target x with b uncertain and leaves b's mean
and covariance as they were. With K = (Kx, Kb) the gain of the optimal filter of (x, b) and S the
covariance of the innovation, Joseph's form with the gain (Kx, 0) gives

    Pxx+ = Pxx - Kx S Kx',    Pxb+ = Pxb - Kx S Kb',    Pbb+ = Pbb,

the first two being those of the optimal filter. So any filter that keeps a Gaussian becomes a
consider filter: let it update target and errors by a whole plot, and put back what is known of the
errors. What is put back exceeds what the optimal filter has by Kb S Kb', so the joint covariance
stays one.

Differs from them: the target is kept where the radar sees it, y = x + M b, and told where it is. A
plot is one of y, whatever b is, so the filter updates y alone, with its own formula, and knows of b
what y tells it: with A = Pyy^-1 Pyb its gain is A' Ky, and A' (Pyy - Pyy+) A is Kb S Kb'. Putting
b back then leaves x as above. In a linear world this is Schmidt's filter to the last digit. In
a curved one (x, b) goes wrong where the errors are more uncertain than plots are noisy: Pxb is
large, of a direction that gradients taken at other places do not quite cancel, and what is left of
it looks like knowledge. Pyb begins at zero in a track that begins with a plot and stays small.

b is put back once a plot, not once a component, so a filter that takes one component after the
other is that of the whole plot too. A plot that is turned away or empty changes nothing.

Every track carries the errors on its own. Two tracks of one radar err alike, by their shares of the
same b; their covariances do not say so.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.filters.recursion import Recursion
from boresight.filters.start import SPEED_MPS
from boresight.filters.steps import Method, State, Surprise, gaussian_layout
from boresight.lanes import Leaf, Matrix
from boresight.maths import Gaussian, jacobian, mirror, solve
from boresight.models.components import Component
from boresight.models.considered import TIME, Considered, ConsideredRadar
from boresight.models.systematic import SystematicErrors

Array = Any


@dataclass(frozen=True, kw_only=True)
class Consider:
    """A filter of a motion `Considered` that corrects the target and never the radar's errors.

    Attributes:
        inner: any filter that keeps a Gaussian in its motion's coordinates.
    """

    inner: Method

    @property
    def plain(self) -> bool:
        """It keeps the target where the radar sees it."""
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
        """The target as the radar sees it, and its covariance with the errors."""
        del sensor
        kept = gaussian_layout(motion.inner)
        return kept | {"shared": Matrix(motion.own, len(motion.terms))}

    def begin(self, start: Gaussian, motion: Considered, sensor: ConsideredRadar) -> State:
        """From target and errors."""
        own, M = motion.own, sensor.displaced(start.mean[: motion.own], motion)
        cov = _moved(start.cov, M)
        return {"mean": start.mean[:own], "cov": cov[:own, :own], "shared": cov[:own, own:]}

    def predict(self, state: State, motion: Considered, sensor: ConsideredRadar, dt: Any) -> State:
        """By the inner filter, and by what bends the path that the radar sees; the errors stay."""
        kept = {"mean": state["mean"], "cov": state["cov"]}
        moved = self.inner.predict(kept, motion.inner, sensor.radar, dt)
        _, F = jacobian(lambda x: motion.inner.move(x, dt), state["mean"])
        before, after = (sensor.displaced(s["mean"], motion) for s in (state, moved))
        G, shared = after - F @ before, F @ state["shared"]
        bent = G @ mirror(sensor.cov)
        cross = (shared + bent * 0.5) @ G.T
        cov = mirror(moved["cov"] + cross + cross.T)
        return {"mean": moved["mean"], "cov": cov, "shared": shared + bent}

    def update(
        self, state: State, z: Array, motion: Considered, sensor: ConsideredRadar
    ) -> tuple[State, Surprise]:
        """By the inner filter; what that told of the errors is put back."""
        mean, cov, shared = state["mean"], state["cov"], state["shared"]
        kept = {"mean": mean, "cov": cov}
        post, surprise = self.inner.update(kept, z, motion.inner, sensor.radar)
        M, A = sensor.displaced(mean, motion), solve(cov, shared)
        lost = (cov - post["cov"]) @ A
        taken = M @ mirror(A.T @ lost)
        return {
            "mean": post["mean"] - M @ (A.T @ (post["mean"] - mean)),
            "cov": mirror(post["cov"] + taken @ M.T),
            "shared": shared - lost + taken,
        }, surprise

    def seen(
        self, state: State, motion: Considered, sensor: ConsideredRadar
    ) -> tuple[Gaussian, Sequence[Component]]:
        """Plots are of the target where the radar sees it."""
        return Gaussian(state["mean"], state["cov"]), sensor.radar.components(motion.inner)

    def output(self, state: State, motion: Considered, sensor: ConsideredRadar) -> Gaussian:
        """Target and errors; the errors' mean is zero, since plots come without it."""
        shared, own, errors = state["shared"], motion.own, mirror(sensor.cov)
        joint = np.block([[state["cov"], shared], [shared.T, errors]])
        cov = np.array(_moved(joint, -sensor.displaced(state["mean"], motion)))
        if TIME in motion.terms:
            # A speed and a time bias that are both uncertain: the variance of their product.
            at, v = own + motion.terms.index(TIME), slice(motion.dims, 2 * motion.dims)
            cov[: motion.dims, : motion.dims] += cov[v, v] * cov[at, at]
        return Gaussian(np.concatenate([state["mean"], np.zeros(len(errors))]), cov)


def _moved(cov: Array, M: Array) -> Array:
    """The joint covariance of x + M b and b, from that of x and b."""
    own, m = M.shape
    T = np.block([[np.eye(own), M], [np.zeros((m, own)), np.eye(m)]])
    return mirror(T @ cov @ T.T)


def consider(recursion: Recursion, errors: SystematicErrors) -> Recursion:
    """The same filter, considering the uncertainty of a radar's systematic errors.

    Args:
        recursion: of a filter that keeps a Gaussian in the motion's coordinates.
        errors: of the radar; their estimate has been taken out of the plots.

    Raises:
        UsageError: the filter keeps something else.
    """
    if not recursion.method.plain:
        raise UsageError(
            "this filter cannot carry the uncertainty of systematic errors",
            why="it keeps another state than a Gaussian in the motion's coordinates",
            next_step="use ekf or mekf",
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
    p, v = start.mean[:, :dims].T, start.mean[:, dims : 2 * dims].T
    T = np.zeros((lanes, own + m, own + m)) + np.eye(own + m)
    T[:, :dims, own:] = -np.moveaxis(sensor.shifts(p, v, motion.terms), -1, 0)
    apart = np.zeros((lanes, own + m, own + m))
    apart[:, :own, :own], apart[:, own:, own:] = start.cov, sensor.cov
    mean = np.concatenate([start.mean, np.zeros((lanes, m))], axis=1)
    return Gaussian(mean, T @ apart @ T.swapaxes(1, 2))

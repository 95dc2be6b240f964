"""What errors of plots look like: laws of noise and outliers, and what is known of the errors."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

Array = Any

# Wide law over narrow, at most: beyond it an error is an outlier. Ranges have hardly a tail.
_WIDEST = {"range_m": 2.0, "azimuth_rad": 4.0, "elevation_rad": 4.0}
_NEAREST = 1.5  # below it the two laws are one
OUTLIER_M, LATE_S = 1_000.0, 2.0  # believed scales of outliers, each worth one pair
_LATEST_S = (1e-2, 1e4)  # bounds of the scale of wrong times
SHARES = (1e-6, 0.5)  # of outliers, and of the wide law: more is not the rarer class any more


@dataclass(frozen=True, kw_only=True, eq=False)
class Laws:
    """Noise of every channel, and outliers.

    Attributes:
        sd: (k,) of the narrow law, m or rad.
        widest: (k,) largest ratio of the wide law to the narrow one.
        tail_share: (k,) of the wide law; 0 makes the channel normal.
        tail_sd: (k,) of the wide law.
        wrong: (2,) shares of pairs at a wrong place and at a wrong time.
        place_m: scale of the displacement at a wrong place.
        late_s, late_sd_s: mean and standard deviation of a wrong time; 0 and 0 if there is none.
    """

    sd: Array
    widest: Array
    tail_share: Array
    tail_sd: Array
    wrong: Array
    place_m: float = OUTLIER_M
    late_s: float = 0.0
    late_sd_s: float = LATE_S

    @property
    def robust(self) -> bool:
        """Whether there is any class but the narrow one."""
        return bool(self.tail_share.any())

    @property
    def outlier_share(self) -> float:
        """Of pairs that are no measurement of their target."""
        return float(self.wrong.sum())

    @property
    def variance(self) -> Array:
        """(k, 1) of both normal laws together."""
        share = self.tail_share
        return ((1.0 - share) * self.sd**2 + share * self.tail_sd**2)[:, None]

    def without_late(self) -> "Laws":
        """No wrong times: what they explained, noise and wrong places explain."""
        return replace(self, wrong=self.wrong * (1.0, 0.0), late_s=0.0, late_sd_s=0.0)

    def no_finer(self, sd: Array) -> "Laws":
        """With narrow laws of these standard deviations (k,) or more."""
        return replace(self, sd=np.maximum(self.sd, sd)).bounded()

    def bounded(self) -> "Laws":
        """Brought back to where laws can be."""
        if not self.robust:
            return self
        return replace(
            self,
            tail_share=np.clip(self.tail_share, *SHARES),
            tail_sd=np.clip(self.tail_sd, _NEAREST * self.sd, self.widest * self.sd),
            wrong=np.clip(self.wrong, [SHARES[0], self.late_sd_s and SHARES[0]], SHARES[1] / 2),
            late_sd_s=float(np.clip(self.late_sd_s, *_LATEST_S)) if self.late_sd_s else 0.0,
        )


class Classes(NamedTuple):
    """To which class the pairs belong, and what follows for the fit.

    Attributes:
        wrong: (2, m) probability of a wrong place and of a wrong time.
        wide: (k, m) probability of the wide law, if the pair is a measurement.
        weight: (k, m) expected inverse variance; 0 where nothing was measured.
        curvature: (k, m) derivative of weight times residual, which is negative in the tails.
        late_s, late_var: (m,) mean and variance of its wrong time, if it has one.
    """

    wrong: Array
    wide: Array
    weight: Array
    curvature: Array
    late_s: Array
    late_var: Array

    @property
    def outlier(self) -> Array:
        """(m,) probability that the pair is no measurement."""
        return self.wrong.sum(0)


class Setting(NamedTuple):
    """What the laws need to know of the pairs, the same in every step.

    Attributes:
        seen: (k, m) 1 where measured, else 0.
        extra: (k, m) or (k, 1) variance that the reference adds.
        lever: (k, m) metres of displacement for one unit of residual; 0 where not measured.
        second: (k, m) what one second of wrong time adds; 0 where not measured.
        count: (m,) channels measured.
        base: (m,) log density of no displacement under a Cauchy law of scale 1 m, times
            (2 pi)^(k/2).
        typical_m: (k,) median lever.
        speed_mps: typical displacement in one second.
    """

    seen: Array
    extra: Array
    lever: Array
    second: Array
    count: Array
    base: Array
    typical_m: Array
    speed_mps: float


def setting(seen: Array, extra: Array, lever: Array, second: Array) -> Setting:
    """Gather what stays the same; `lever` and `second` (k, m) are needed where seen."""
    from scipy.special import gammaln

    count = seen.sum(0)
    units = (seen * np.log(lever)).sum(0)
    base = gammaln(0.5 * (1.0 + count)) - 0.5 * np.log(np.pi) + 0.5 * count * np.log(2.0) + units
    lever, second = seen * lever, seen * second
    speed = float(np.sqrt(np.median(((lever * second) ** 2).sum(0))))
    return Setting(seen, extra, lever, second, count, base, np.median(lever, axis=1), speed)


class Errors(NamedTuple):
    """What is known of the pairs' errors at some point of the fit.

    Attributes:
        left: (k, m) residuals, m or rad; 0 where nothing was measured.
        square: (k, m) their expected squares, what was taken out being uncertain.
        at: the pairs.
    """

    left: Array
    square: Array
    at: Setting

    def part(self, rows: slice) -> "Errors":
        """Some of the pairs."""
        at = self.at
        extra = at.extra if at.extra.shape[1] == 1 else at.extra[:, rows]
        some = at._replace(
            seen=at.seen[:, rows],
            extra=extra,
            lever=at.lever[:, rows],
            second=at.second[:, rows],
            count=at.count[rows],
            base=at.base[rows],
        )
        return Errors(self.left[:, rows], self.square[:, rows], some)


def first_laws(channels: tuple[str, ...], sd: Array, *, robust: bool) -> Laws:
    """Where the search for laws starts, from robust standard deviations (k,)."""
    widest = np.array([_WIDEST[channel] for channel in channels])
    return Laws(
        sd=sd,
        widest=widest,
        tail_share=np.full(len(sd), 0.1 if robust else 0.0),
        tail_sd=widest * sd,
        wrong=np.full(2, 0.03 if robust else 0.0),
    )

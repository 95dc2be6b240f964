"""The noise of plots from the last so many differences: a window that shifts, branch-free.

Paper: kashyap sections 2 and 3.2, "windowing method", length 10.
Differs from it: the paper gives no formula. Here it is the sample covariance about the mean
(erratum K13), of a channel's own last differences, or, where covariances are kept, of the last
scans that had all channels. Until it is warm the noise is the sensor's own.
"""

from typing import Any

import numpy as np

from boresight.maths import missing, select
from boresight.models.error_model import ErrorModel

Array = Any


def pushed(last: Array, count: Array, entries: Array, *, together: bool) -> tuple[Array, Array]:
    """The window and its fill with one more entry where there is one.

    Args:
        last: (w, c), newest first.
        count: (c,) entries so far, at most w.
        entries: (c,) NaN where there is none.
        together: whether a row needs all channels.
    """
    length, channels = last.shape
    gone = [missing(sum(entries))] * channels if together else [missing(e) for e in entries]
    columns, counts = [], []
    for i in range(channels):
        new = [select(gone[i], 0.0, entries[i]), *last[:-1, i]]
        pairs = zip(new, last[:, i], strict=True)
        columns.append([select(gone[i], old, shifted) for shifted, old in pairs])
        room = select(count[i] < length - 0.5, 1.0, 0.0)
        counts.append(count[i] + select(gone[i], 0.0, room))
    return np.array(columns).T, np.array(counts)


def noise_of(model: ErrorModel, last: Array, count: Array, nominal: Array) -> Array:
    """Covariance of the plot's noise, (c, c).

    Args:
        model: its warm-up, floor, and whether covariances are kept.
        last: (w, c), newest first.
        count: (c,) how much of it is filled.
        nominal: (c, c) the sensor's own.
    """
    filled = np.array([[select(n > i + 0.5, 1.0, 0.0) for n in count] for i in range(len(last))])
    safe = np.array([select(n > 1.5, n, 2.0) for n in count])
    off = (last - (last * filled).sum(0) / safe) * filled
    warm = (model.warm_up or model.window or 2) - 0.5
    c = len(count)
    R = [[nominal[i, j] for j in range(c)] for i in range(c)]
    for i in range(c):
        for j in range(c) if model.noise == "full" else (i,):
            sample = sum(a * b for a, b in zip(off[:, i], off[:, j], strict=True)) / (safe[i] - 1.0)
            share = model.floor * nominal[i, j]
            R[i][j] = select(count[i] > warm, (1.0 - model.floor) * sample + share, nominal[i, j])
    return np.array(R)

"""Times of day into seconds since midnight of the first day: over midnight, sensor by sensor."""

import numpy as np
from numpy.typing import NDArray

from boresight.formats.wire import Integers

DAY_S = 86_400.0
_EVERY = 64  # records between the times kept to place another sensor's first one


class Clock:
    """Unwraps the times of one recording; it remembers where each sensor's time stands.

    A sensor's first time is put on the day that is nearest to what other sensors showed at that
    place of the file, each next one on the day nearest to the one before.
    """

    def __init__(self) -> None:
        self._last: dict[int, float] = {}
        self._places: Integers = np.empty(0, np.int64)
        self._times: NDArray[np.float64] = np.empty(0)

    def unwrap(
        self, sensor: Integers, time_of_day_s: NDArray[np.float64], place: Integers
    ) -> NDArray[np.float64]:
        """Return seconds since midnight of the first day.

        Args:
            sensor: (n,) code of the sensor.
            time_of_day_s: (n,) seconds since midnight, NaN where unknown.
            place: (n,) offset in the file, ascending.
        """
        times = np.full(len(sensor), np.nan)
        for code in np.unique(sensor).tolist():
            rows = np.flatnonzero((sensor == code) & ~np.isnan(time_of_day_s))
            if len(rows):
                times[rows] = self._one(code, time_of_day_s[rows], place[rows])
        return times

    def _one(self, code: int, times: NDArray[np.float64], place: Integers) -> NDArray[np.float64]:
        before = self._last.get(code, self._at(int(place[0]), float(times[0])))
        first_day = np.rint((before - times[0]) / DAY_S)
        days = first_day - np.cumsum(np.rint(np.diff(times, prepend=times[0]) / DAY_S))
        unwrapped: NDArray[np.float64] = times + DAY_S * days
        self._last[code] = float(unwrapped[-1])
        self._keep(place[::_EVERY], unwrapped[::_EVERY])
        return unwrapped

    def _at(self, place: int, default: float) -> float:
        """Return what the recording's clock showed at an offset of the file."""
        if not len(self._places):
            return default
        index = int(np.searchsorted(self._places, place, side="right")) - 1
        return float(self._times[max(index, 0)])

    def _keep(self, places: Integers, times: NDArray[np.float64]) -> None:
        """Add times to the trail where it has none yet."""
        if not len(self._places) or places[0] > self._places[-1]:
            self._places = np.concatenate([self._places, places])
            self._times = np.concatenate([self._times, times])

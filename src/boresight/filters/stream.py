"""One step at a time, live: state in, state out, in microseconds.

    step = stream(recursion)
    state = step.start(plot)
    state = step(state, plot, dt=4.0)
    state = step(state, plot, dt=4.0, sensor=moved)  # own ship sails: the same sensor, elsewhere

Nothing changes after birth: a state can be kept, branched and replayed, and the same plots give the
same bits live as in a batch of thousands.
"""

import ctypes
import struct
from collections.abc import Mapping
from ctypes import addressof
from dataclasses import replace
from typing import Any

import numpy as np

from boresight.errors import Status, UsageError
from boresight.filters.recursion import SUMMARY, Recursion
from boresight.filters.stream_numbers import moved, rated
from boresight.lanes import BLOCK, Kernel, Rate, States, Symmetric
from boresight.maths import Gaussian
from boresight.models.checks import as_number
from boresight.models.parameters import structure
from boresight.models.sensors import Sensor

Array = Any
_FOREVER = float("inf")


class StreamState:
    """The state of one target or many after a step.

    `mean` (n,) and `cov` (n, n), with a leading axis where the stream holds several targets;
    `nis`, `dof` and `loglik` of the last plot; `status`, a `Status`.
    """

    __slots__ = ("_stream", "buffer")

    def __init__(self, stream: "Stream", buffer: Any) -> None:
        self._stream = stream
        self.buffer = buffer  # the kernel's own memory: blocked state, summary, dt and the plot

    @property
    def mean(self) -> Array:
        """State mean."""
        return self._stream.leaf(self.buffer, "mean")

    @property
    def cov(self) -> Array:
        """State covariance."""
        return self._stream.leaf(self.buffer, "cov")

    @property
    def nis(self) -> Any:
        """Normalised innovation squared of the last plot; 0 after a start."""
        return self._stream.output(self.buffer, "nis")

    @property
    def dof(self) -> Any:
        """How many components the last plot measured."""
        return self._stream.output(self.buffer, "dof")

    @property
    def loglik(self) -> Any:
        """Log-likelihood of the last plot."""
        return self._stream.output(self.buffer, "loglik")

    @property
    def status(self) -> Any:
        """`Status` of the state; for several targets an array of codes."""
        code = self._stream.output(self.buffer, "status")
        return Status(int(code)) if np.ndim(code) == 0 else code.astype(int)


class Stream:
    """A filter for one target (targets=None) or a fixed number of them, fed plot by plot."""

    def __init__(self, recursion: Recursion, targets: int | None = None) -> None:
        if targets is not None and (not isinstance(targets, int) or targets < 1):
            raise UsageError(
                f"targets={targets!r} is no number of targets", next_step="leave it out for one"
            )
        self.recursion, self.targets = recursion, targets
        self._lanes = 1 if targets is None else targets
        self._components = len(recursion.sensor.names)
        found = rated(recursion.models(), self._lanes)
        rates = {name: rate for name, (rate, _) in found.items()}
        rates |= {"z": Rate.EACH, "dt": Rate.FIXED}
        # A method that keeps something else than it tells has the telling written beside it.
        self._written = "summary" if recursion.method.plain else "told"
        self._kernel: Kernel = recursion.kernel(rates, {self._written: Rate.LANE})
        self._structure = structure(recursion.sensor)
        self._values = {name: value for name, (_, value) in found.items()}
        self._bind()

    def _bind(self) -> None:
        """Fix addresses and sizes once: looking them up costs more than the filter does."""
        program, code = self._kernel.program, self._kernel.code
        self._state_numbers = -(-self._lanes // BLOCK) * program.state_size * BLOCK
        self._width = program.outputs[0].leaf.size
        self._clock = self._state_numbers + self._width * self._lanes
        count = self._components * self._lanes
        self._buffer_type: Any = ctypes.c_double * (self._clock + 1 + count)
        self._pack = struct.Struct(f"{1 + count}d").pack_into
        self._summary_at, self._clock_at = 8 * self._state_numbers, 8 * self._clock  # bytes
        names = [slot.name for slot in program.inputs]
        if names[:2] != ["z", "dt"]:
            raise AssertionError("the recursion declares the plot and dt first")
        self._keep = {n: np.asarray(self._values[n], order="C") for n in names[2:]}
        if code:
            # The words of a call (`Code.frame`): what never changes, packed once, around what does.
            self._head = struct.pack("4q", 0, code.chunks(self._lanes), 1, self._lanes)
            self._middle = struct.Struct("5q").pack
            self._tail = _addresses(self._keep)
            self._call = code.call

    def start(
        self,
        plot: Array | Gaussian,
        *,
        speed_mps: float | None = None,
        sensor: Sensor | None = None,
    ) -> StreamState:
        """Begin from a plot (k,) or (targets, k), or from a Gaussian.

        Args:
            plot: the first one, or what is known of the targets.
            speed_mps: see `run`.
            sensor: as it was at this plot; left out, the stream's own.
        """
        recursion, prior = self.recursion, plot
        if sensor is not None:
            self._moved(sensor)
            recursion = replace(recursion, sensor=sensor)
        if not isinstance(plot, Gaussian):
            rows = self._first_rows(plot)
            models = recursion.motion, recursion.sensor
            spread: dict[str, Any] = {} if speed_mps is None else {"speed_mps": speed_mps}
            prior = recursion.method.start(rows, *models, **spread)
        n = len(recursion.motion.names)
        if np.shape(prior.mean)[-1:] != (n,):
            raise UsageError(
                f"a start with mean {np.shape(prior.mean)}",
                why=f"the motion has the states {', '.join(recursion.motion.names)}",
            )
        states = recursion.states(prior, self._lanes)
        buffer = self._buffer_type()
        np.frombuffer(buffer)[: self._state_numbers] = states.data.ravel()
        self._tell(buffer, prior)
        return StreamState(self, buffer)

    def _first_rows(self, plot: Array) -> Array:
        """The plot of each target as a row."""
        rows = np.asarray(as_number("plot", plot))
        if rows.shape[-1:] != (self._components,) or rows.size != self._lanes * self._components:
            raise self._wrong(plot)
        return np.where(np.isinf(rows), np.nan, rows).reshape(self._lanes, self._components)

    def _tell(self, buffer: Any, prior: Gaussian) -> None:
        """Before its first plot a target is where its start says, if that says where."""
        n = len(self.recursion.motion.names)
        told = self._rows(buffer)
        known = np.isfinite(prior.mean).all(-1) & np.isfinite(prior.cov).all((-2, -1))
        told[:, SUMMARY.index("status")] = np.where(known, Status.OK, Status.NOT_STARTED)
        if self._written == "summary":
            return
        told[:, len(SUMMARY) : len(SUMMARY) + n] = prior.mean
        told[:, len(SUMMARY) + n :] = Symmetric(n).pack(prior.cov)

    def __call__(
        self, state: StreamState, plot: Array, dt: float, *, sensor: Sensor | None = None
    ) -> StreamState:
        """The state after dt seconds and a plot.

        Args:
            state: where the targets were; not changed.
            plot: (k,) or (targets, k), SI units and radians, NaN where missing.
            dt: seconds since that state, not negative.
            sensor: as it was at this plot: another pose, other noise, the same structure. It holds
                for this call; left out, the stream's own.
        """
        try:
            runs_forward = 0.0 <= dt < _FOREVER
        except (TypeError, ValueError):
            runs_forward = False
        if not runs_forward:
            raise UsageError(
                f"dt={dt!r} s: time does not go backwards, nor without end",
                next_step="keep the states of earlier plots and step again from the one before",
            )
        if not isinstance(state, StreamState) or type(state.buffer) is not self._buffer_type:
            raise UsageError(
                "the state is that of a stream with other sizes, or none",
                next_step="begin with state = stream.start(plot)",
            )
        buffer = self._buffer_type()
        self._accept(buffer, plot, dt)
        given = self._keep if sensor is None else self._keep | self._moved(sensor)
        if self._kernel.code is None:
            self._in_numpy(state.buffer, buffer, given)
        else:
            tail = self._tail if sensor is None else _addresses(given)
            self._in_kernel(addressof(state.buffer), addressof(buffer), tail)
        return StreamState(self, buffer)

    def _moved(self, sensor: Sensor) -> dict[str, Array]:
        return moved(sensor, self._structure, self._keep, self._lanes)

    def _accept(self, buffer: Any, plot: Array, dt: float) -> None:
        """Write dt and the plot behind the new state."""
        if self.targets is None:
            numbers = plot.tolist() if type(plot) is np.ndarray else plot  # Python floats are quick
            try:
                self._pack(buffer, self._clock_at, dt, *numbers)
            except (struct.error, TypeError):
                raise self._wrong(plot) from None
        elif np.shape(plot) == (self._lanes, self._components):
            numbers = np.frombuffer(buffer)[self._clock :]
            numbers[0], numbers[1:] = dt, np.ravel(plot)
        else:
            raise self._wrong(plot)

    def _in_kernel(self, old: int, new: int, tail: bytes) -> None:
        clock = new + self._clock_at
        varying = self._middle(old, new, new + self._summary_at, clock + 8, clock)
        self._call(self._head + varying + tail)

    def _in_numpy(self, old: Any, new: Any, given: dict[str, Array]) -> None:
        numbers = np.frombuffer(new)
        z = numbers[self._clock + 1 :].reshape(self._lanes, 1, self._components)
        values = self._values | given | {"z": z, "dt": numbers[self._clock]}
        final, outputs = self._kernel.run(self._states(old), values, 1)
        numbers[: self._state_numbers] = final.data.ravel()
        numbers[self._state_numbers : self._clock] = outputs[self._written].ravel()

    def _wrong(self, plot: Any) -> UsageError:
        shape = (self._components,) if self.targets is None else (self._lanes, self._components)
        return UsageError(
            f"a plot has shape {np.shape(plot)}; {shape} numbers are needed",
            why=f"the sensor measures {', '.join(self.recursion.sensor.names)}",
        )

    def _states(self, buffer: Any) -> States:
        program = self._kernel.program
        data = np.frombuffer(buffer)[: self._state_numbers]
        return States(program.state, data.reshape(-1, program.state_size, 8), self._lanes)

    def _rows(self, buffer: Any) -> Array:
        """What was written after the last step, (targets, width)."""
        numbers = np.frombuffer(buffer)[self._state_numbers : self._clock]
        return numbers.reshape(self._lanes, self._width)

    def leaf(self, buffer: Any, name: str) -> Array:
        """`mean` or `cov` as a plain array."""
        n, first = len(self.recursion.motion.names), len(SUMMARY)
        if self._written == "summary":
            value = self._states(buffer)[name]
        elif name == "mean":
            value = self._rows(buffer)[:, first : first + n].copy()
        else:
            value = Symmetric(n).unpack(self._rows(buffer)[:, first + n :])
        return value[0] if self.targets is None else value

    def output(self, buffer: Any, name: str) -> Any:
        """An output of the last step: a number, or (targets,)."""
        column = self._rows(buffer)[:, SUMMARY.index(name)]
        return float(column[0]) if self.targets is None else column.copy()


def _addresses(arrays: Mapping[str, Array]) -> bytes:
    """Where the kernel finds them, as it wants it."""
    return struct.pack(f"{len(arrays)}q", *(array.ctypes.data for array in arrays.values()))

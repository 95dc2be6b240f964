"""Running a program over lanes and steps: blocked state, rows in and out, threads.

State lives in blocks of 8 lanes, [block, number, 8], from one call to the next. Inputs and outputs
are plain rows, which the kernel packs itself, or blocks where a caller makes data blocked already.
What is summed over lanes is summed over each block, always.
"""

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.lanes.interpreter import paired, run_numpy
from boresight.lanes.places import BLOCK
from boresight.lanes.program import Program, Rate, Slot
from boresight.lanes.simd import Code, compile_program

Array = Any


def to_blocks(rows: Array) -> Array:
    """(lanes, ..., size) to (blocks, ..., size, 8); the last lane pads its block."""
    lanes = len(rows)
    padded = rows[np.minimum(np.arange(-(-lanes // BLOCK) * BLOCK), lanes - 1)]
    return np.ascontiguousarray(np.moveaxis(padded.reshape(-1, BLOCK, *rows.shape[1:]), 1, -1))


def from_blocks(blocks: Array, lanes: int) -> Array:
    """The inverse of `to_blocks`."""
    rows = np.moveaxis(blocks, -1, 1)
    return np.ascontiguousarray(rows.reshape(-1, *rows.shape[2:])[:lanes])


@dataclass(frozen=True, eq=False)
class States:
    """The state of many lanes, blocked. Index by leaf name for plain arrays.

    Attributes:
        slots: the state's leaves, in the order in which they are stored.
        data: (blocks, numbers, 8), float64, C-contiguous.
        lanes: number of lanes in use; the last block's spare lanes repeat the last lane.
    """

    slots: tuple[Slot, ...]
    data: Array
    lanes: int

    def __getitem__(self, name: str) -> Array:
        """Leaf `name` as (lanes, *shape)."""
        start = 0
        for slot in self.slots:
            if slot.name == name:
                part = self.data[:, start : start + slot.leaf.size]
                return slot.leaf.unpack(from_blocks(part, self.lanes))
            start += slot.leaf.size
        raise KeyError(name)

    @property
    def rows(self) -> Array:
        """All leaves, packed: (lanes, numbers)."""
        return from_blocks(self.data, self.lanes)


def pack_states(slots: tuple[Slot, ...], values: Mapping[str, Array]) -> States:
    """Plain arrays (lanes, *shape), one for each leaf, to blocked state."""
    rows = np.concatenate([slot.leaf.pack(values[slot.name]) for slot in slots], axis=-1)
    return States(slots, to_blocks(rows), len(rows))


@dataclass(frozen=True, eq=False)
class Kernel:
    """A program ready to run: compiled where it can be, in NumPy where it cannot."""

    program: Program
    rows: bool
    code: Code | None

    def __reduce__(self) -> tuple[Any, ...]:
        """Machine code does not travel; the program does, and is loaded from the cache there."""
        return make_kernel, (self.program, self.rows)

    def run(
        self,
        states: States,
        inputs: Mapping[str, Array],
        steps: int,
        *,
        threads: int = 1,
        out: Mapping[str, Array] | None = None,
    ) -> tuple[States, dict[str, Array]]:
        """Run every lane through `steps` steps.

        Args:
            states: where the lanes start; not changed.
            inputs: by name: FIXED (*shape), STEP (steps, *shape), LANE (lanes, *shape), EACH
                (lanes, steps, *shape); LANE and EACH are blocked if the kernel is.
            steps: number of steps, at least 1.
            threads: how many threads share the lanes, at least 1; the result does not depend on it.
            out: arrays of an earlier call to write outputs into, by name, packed as the kernel
                writes them; making new ones for a large run costs a fifth of the filter.

        Returns:
            The new states, and the outputs by name: EACH (lanes, steps, *shape), LANE
            (lanes, *shape), blocked and packed if the kernel is; STEP (lanes / 8, steps, *shape),
            sums over blocks.

        Raises:
            UsageError: steps, threads, the state or an input does not fit; compiled code would
                read past its memory.
        """
        self._check(states, steps, threads)
        packed = [self._pack(slot, inputs, states.lanes, steps) for slot in self.program.inputs]
        if self.code is None:
            return self._run_numpy(states, packed, steps, out or {})
        new = np.empty_like(states.data)
        outputs = [self._output(s, states.lanes, steps, out or {}) for s in self.program.outputs]
        written = [
            self._scratch(s, each) for s, each in zip(self.program.outputs, outputs, strict=True)
        ]
        arrays = (states.data, new, *written, *packed)
        addresses = [array.__array_interface__["data"][0] for array in arrays]  # .ctypes is slow
        chunks = self.code.chunks(states.lanes)
        parts = max(1, min(threads, chunks))
        cuts = [i * chunks // parts for i in range(parts + 1)]
        call, pack = self.code.call, self.code.frame.pack

        def part(first: int, last: int) -> None:
            call(pack(first, last, steps, states.lanes, *addresses))

        if parts == 1:
            part(0, chunks)
        else:
            list(_pool().map(part, cuts[:-1], cuts[1:]))
        for whole, halves in zip(outputs, written, strict=True):
            if whole is not halves:
                whole[...] = paired(halves, len(whole))
        return States(states.slots, new, states.lanes), self._unpack(outputs)

    def _check(self, states: States, steps: int, threads: int) -> None:
        if steps < 1 or threads < 1:
            raise UsageError(f"a kernel runs at least one step; got {steps=}, {threads=}")
        summed = [slot.name for slot in self.program.outputs if slot.rate == Rate.STEP]
        if summed and states.lanes % BLOCK:
            raise UsageError(
                f"{summed[0]!r} is summed over blocks of {BLOCK} lanes; got {states.lanes} lanes",
                next_step="fill the last block with lanes that count for nothing",
            )
        expected = (-(-states.lanes // BLOCK), self.program.state_size, BLOCK)
        if states.data.shape != expected or not states.data.flags.c_contiguous:
            names = ", ".join(f"{slot.name} {slot.leaf.shape}" for slot in self.program.state)
            raise UsageError(
                f"the state has blocks {states.data.shape}; {expected} is needed",
                why=f"this kernel carries {names}",
            )

    def _pack(self, slot: Slot, inputs: Mapping[str, Array], lanes: int, steps: int) -> Array:
        if slot.name not in inputs:
            raise UsageError(f"input {slot.name!r} is missing; got {sorted(inputs)}")
        sizes: dict[Rate, tuple[int, ...]] = {Rate.FIXED: (), Rate.STEP: (steps,)}
        sizes |= {Rate.LANE: (lanes,), Rate.EACH: (lanes, steps)}
        expected = (*sizes[slot.rate], slot.leaf.size)
        if self.rows or not slot.rate & Rate.LANE:
            array = np.ascontiguousarray(slot.leaf.pack(inputs[slot.name]))
        else:
            expected = (-(-lanes // BLOCK), *expected[1:], BLOCK)
            array = np.ascontiguousarray(inputs[slot.name], dtype=float)
        if array.shape != expected:
            raise UsageError(
                f"input {slot.name!r} has shape {np.shape(inputs[slot.name])}",
                why=f"it is declared {slot.rate.name} with {lanes} lanes and {steps} steps",
            )
        return array

    def _output(self, slot: Slot, lanes: int, steps: int, out: Mapping[str, Array]) -> Array:
        middle = () if slot.rate == Rate.LANE else (steps,)
        shape: tuple[int, ...] = (lanes, *middle, slot.leaf.size)
        if slot.rate == Rate.STEP:
            shape = (lanes // BLOCK, steps, slot.leaf.size)
        elif not self.rows:
            shape = (-(-lanes // BLOCK), *middle, slot.leaf.size, BLOCK)
        given = out.get(slot.name)
        if given is None:
            return np.empty(shape)
        fits = given.dtype == float and given.flags.c_contiguous and given.flags.writeable
        if given.shape != shape or not fits:
            raise UsageError(
                f"out[{slot.name!r}] of shape {given.shape} and type {given.dtype} does not fit",
                why=f"the kernel writes {shape}, float64, C-contiguous",
            )
        return given

    def _scratch(self, slot: Slot, output: Array) -> Array:
        """Where the code writes an output: sums over fewer lanes than a block's are added here."""
        parts = BLOCK // self.code.shape.width if self.code else 1
        if slot.rate != Rate.STEP or parts == 1:
            return output
        return np.empty((parts * len(output), *output.shape[1:]))

    def _unpack(self, outputs: list[Array]) -> dict[str, Array]:
        slots = self.program.outputs
        if not self.rows:
            return {slot.name: a for slot, a in zip(slots, outputs, strict=True)}
        return {slot.name: slot.leaf.unpack(a) for slot, a in zip(slots, outputs, strict=True)}

    def _run_numpy(
        self, states: States, packed: list[Array], steps: int, out: Mapping[str, Array]
    ) -> tuple[States, dict[str, Array]]:
        names = [slot.name for slot in self.program.inputs]
        blocked = [not self.rows and bool(s.rate & Rate.LANE) for s in self.program.inputs]
        rows = {
            name: from_blocks(a, states.lanes) if b else a
            for name, a, b in zip(names, packed, blocked, strict=True)
        }
        state, outputs = run_numpy(self.program, states.lanes, steps, states.rows, rows)
        results = [
            outputs[slot.name]
            if self.rows or slot.rate == Rate.STEP
            else to_blocks(outputs[slot.name])
            for slot in self.program.outputs
        ]
        written = [self._output(s, states.lanes, steps, out) for s in self.program.outputs]
        for target, result in zip(written, results, strict=True):
            target[...] = result
        return States(states.slots, to_blocks(state), states.lanes), self._unpack(written)


def make_kernel(program: Program, rows: bool = True) -> Kernel:  # noqa: FBT001, FBT002 - pickled
    """A kernel for this machine; `rows` chooses plain rows or blocks for inputs and outputs."""
    return Kernel(program, rows, compile_program(program, rows=rows))


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count() or 1, thread_name_prefix="boresight")


if hasattr(os, "register_at_fork"):  # a child inherits the pool without its threads
    os.register_at_fork(after_in_child=_pool.cache_clear)

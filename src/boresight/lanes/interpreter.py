"""A program run in NumPy over lanes: the oracle of the compiled form, and its fallback."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from boresight.lanes.places import BLOCK
from boresight.lanes.program import Program, Rate
from boresight.lanes.trace import FOLD

Array = Any


def run_numpy(
    program: Program,
    lanes: int,
    steps: int,
    state: Array,
    inputs: Mapping[str, Array],
) -> tuple[Array, dict[str, Array]]:
    """Run in NumPy over lanes.

    Args:
        program: what to run.
        lanes: number of lanes.
        steps: number of steps.
        state: (lanes, state_size), the flattened state; not changed.
        inputs: by name, packed: FIXED (size,), STEP (steps, size), LANE (lanes, size),
            EACH (lanes, steps, size).

    Returns:
        The new state, and by name the outputs: EACH (lanes, steps, size), LANE (lanes, size), STEP
        (lanes / 8, steps, size).
    """
    state = np.array(state, dtype=float)
    shapes = {Rate.EACH: (lanes, steps), Rate.LANE: (lanes,), Rate.STEP: (lanes // BLOCK, steps)}
    outputs = {s.name: np.empty((*shapes[s.rate], s.leaf.size)) for s in program.outputs}
    memory: list[Any] = [None] * len(program.nodes)
    with np.errstate(all="ignore"):
        for rate in (Rate.FIXED, Rate.LANE):
            _evaluate(program, memory, {rate}, inputs, state, 0)
        for t in range(steps):
            _evaluate(program, memory, {Rate.STEP, Rate.EACH}, inputs, state, t)
            for slot, numbers in zip(program.outputs, program.output_nodes, strict=True):
                target = outputs[slot.name]
                place = target if slot.rate == Rate.LANE else target[:, t]
                for k, n in enumerate(numbers):
                    each = memory[n]
                    if slot.rate == Rate.STEP:
                        each = paired(np.broadcast_to(each, lanes), lanes // BLOCK)
                    place[:, k] = each
            state = (
                np.stack([np.broadcast_to(memory[n], lanes) for n in program.state_nodes], axis=-1)
                if program.state_nodes
                else state
            )
    return state, outputs


def paired(parts: Array, count: int) -> Array:
    """Sums over the first axis down to `count` of them, each of two neighbours, time after time."""
    while len(parts) > count:
        parts = parts[0::2] + parts[1::2]
    return parts


def _evaluate(
    program: Program,
    memory: list[Any],
    rates: set[Rate],
    inputs: Mapping[str, Array],
    state: Array,
    t: int,
) -> None:
    offsets = _state_offsets(program)
    declared = {s.name: s.rate for s in program.inputs}
    for i, ((op, args), rate) in enumerate(zip(program.nodes, program.rates, strict=True)):
        if rate not in rates:
            continue
        if op == "const":
            memory[i] = np.frombuffer(args[0])[0]
        elif op != "input":
            memory[i] = FOLD[op](*(memory[a] for a in args))
        elif args[0] in offsets:
            memory[i] = state[:, offsets[args[0]] + args[1]]
        else:
            where = {Rate.FIXED: (), Rate.STEP: (t,), Rate.LANE: (slice(None),)}
            place = where.get(declared[args[0]], (slice(None), t))
            memory[i] = inputs[args[0]][(*place, args[1])]


def _state_offsets(program: Program) -> dict[str, int]:
    offsets, total = {}, 0
    for slot in program.state:
        offsets[f"state.{slot.name}"] = total
        total += slot.leaf.size
    return offsets

"""A recorded formula as a straight-line program: what goes in, what comes out, what varies.

Every input is declared with its rate: fixed for a call, per lane, per step (the same for all
lanes), or per step and lane. What depends on less is computed less often (hoisted).
"""

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntFlag
from typing import Any

import numpy as np

from boresight.errors import FormulaError, UsageError
from boresight.lanes.philox import COST
from boresight.lanes.refusals import located
from boresight.lanes.trace import COMPARISONS, Graph

Array = Any
_NUMPY_S = (TypeError, ValueError, ArithmeticError, AttributeError, LookupError)  # what it raises
LARGEST = 8_000  # operations; compile time grows faster than linearly above it
_COSTS = {"const": 0, "input": 0, "philox0": COST, "philox1": COST}


class Rate(IntFlag):
    """How often an input changes; also how often a node must be computed."""

    FIXED = 0
    STEP = 1
    LANE = 2
    EACH = 3


_RATES = tuple(Rate(i) for i in range(4))


@dataclass(frozen=True)
class Leaf:
    """Shape of one declared array: `()`, `(n,)` or `(m, n)`; symmetric keeps the upper triangle."""

    shape: tuple[int, ...] = ()
    symmetric: bool = False

    @property
    def size(self) -> int:
        """Numbers kept for one target."""
        if self.symmetric:
            return self.shape[0] * (self.shape[0] + 1) // 2
        return math.prod(self.shape)

    def build(self, numbers: Sequence[Any]) -> Any:
        """The array (or scalar) of `size` numbers, floats or symbols, for one target."""
        if not self.shape:
            return numbers[0]
        flat = np.array(list(numbers))
        return flat[_mirror(self.shape[0])] if self.symmetric else flat.reshape(self.shape)

    def flatten(self, value: Any) -> list[Any]:
        """The inverse of `build`."""
        array = np.asarray(value)
        if array.shape != self.shape:
            raise FormulaError(
                f"declared shape {self.shape}, but the formula gave {array.shape}",
                next_step="declare the leaf in the shape that the formula gives",
            )
        return list(array[np.triu_indices(self.shape[0])] if self.symmetric else array.ravel())

    def pack(self, values: Array) -> Array:
        """(lanes, *shape) to (lanes, size)."""
        values = np.asarray(values, dtype=float)
        if values.shape[values.ndim - len(self.shape) :] != self.shape:
            raise UsageError(f"numbers of shape {values.shape} do not end in {self.shape}")
        if self.symmetric:
            return values[(..., *np.triu_indices(self.shape[0]))]
        return values.reshape(*values.shape[: values.ndim - len(self.shape)], self.size)

    def unpack(self, rows: Array) -> Array:
        """(..., size) to (..., *shape)."""
        if self.symmetric:
            return rows[..., _mirror(self.shape[0])]
        return rows.reshape(*rows.shape[:-1], *self.shape)


def _mirror(n: int) -> Array:
    """Positions of the full (n, n) matrix within the packed upper triangle."""
    index = np.zeros((n, n), dtype=int)
    rows, columns = np.triu_indices(n)
    index[rows, columns] = index[columns, rows] = np.arange(len(rows))
    return index


def Scalar() -> Leaf:
    """One number."""
    return Leaf()


def Vector(n: int) -> Leaf:
    """An array (n,)."""
    return Leaf((n,))


def Matrix(m: int, n: int) -> Leaf:
    """An array (m, n)."""
    return Leaf((m, n))


def Symmetric(n: int) -> Leaf:
    """A symmetric array (n, n), kept as its upper triangle."""
    return Leaf((n, n), symmetric=True)


@dataclass(frozen=True)
class Slot:
    """A named leaf of the program with its rate.

    An output of rate EACH is written at every step, one of rate LANE after the last, and of one of
    rate STEP the sum over the 8 lanes of a block, at every step.
    """

    name: str
    leaf: Leaf
    rate: Rate = Rate.EACH


@dataclass(frozen=True)
class Program:
    """A straight-line program; nodes are in the order in which they were recorded.

    Attributes:
        nodes: (operation, arguments); arguments are node numbers, except for constants and inputs.
        rates: how often each node must be computed.
        inputs: declared inputs.
        state: what travels from step to step, per lane.
        outputs: what is written: at every step, after the last, or summed over lanes (`Slot`).
        state_nodes: nodes of the new state, in the order of the flattened state.
        output_nodes: nodes of each output.
    """

    nodes: tuple[tuple[str, tuple[Any, ...]], ...]
    rates: tuple[Rate, ...]
    inputs: tuple[Slot, ...]
    state: tuple[Slot, ...]
    outputs: tuple[Slot, ...]
    state_nodes: tuple[int, ...]
    output_nodes: tuple[tuple[int, ...], ...]

    @property
    def operations(self) -> int:
        """Arithmetic operations of one step and lane; hoisted work is not counted."""
        return sum(
            _COSTS.get(op, 1)
            for (op, _), rate in zip(self.nodes, self.rates, strict=True)
            if rate == Rate.EACH
        )

    @property
    def state_size(self) -> int:
        """Numbers of state per lane."""
        return sum(slot.leaf.size for slot in self.state)

    @property
    def digest(self) -> str:
        """Identity of the program: equal digests mean equal programs."""
        return hashlib.sha256(repr(self).encode()).hexdigest()

    def __str__(self) -> str:
        """The program as text, one operation a line."""
        lines = []
        for i, ((op, args), rate) in enumerate(zip(self.nodes, self.rates, strict=True)):
            if op == "const":
                text = repr(np.frombuffer(args[0])[0].item())
            elif op == "input":
                text = f"{args[0]}[{args[1]}]"
            else:
                text = f"{op} " + ", ".join(f"%{a}" for a in args)
            lines.append(f"%{i} = {text}  # {rate.name}")
        written, start = [], 0
        for slot in self.state:
            numbers = self.state_nodes[start : start + slot.leaf.size]
            written.append((f"state.{slot.name}", numbers))
            start += slot.leaf.size
        for slot, numbers in zip(self.outputs, self.output_nodes, strict=True):
            written.append((slot.name, numbers))
        lines += [f"{name} = " + ", ".join(f"%{n}" for n in numbers) for name, numbers in written]
        return "\n".join(lines)


def _declare(graph: Graph, slot: Slot) -> Any:
    return slot.leaf.build([graph.input(slot.name, i) for i in range(slot.leaf.size)])


def trace(
    step: Callable[[dict[str, Any], dict[str, Any]], tuple[Mapping[str, Any], Mapping[str, Any]]],
    *,
    state: Mapping[str, Leaf],
    inputs: Mapping[str, tuple[Leaf, Rate]],
    outputs: Mapping[str, tuple[Leaf, Rate]],
) -> Program:
    """Record `step(state, inputs) -> (new state, outputs)`, a formula for one target.

    Args:
        step: called once, with dictionaries of arrays of symbols.
        state: what travels from step to step.
        inputs: leaf and rate of every input.
        outputs: leaf and rate of the outputs the caller wants; others are not computed.

    Returns:
        The program, without operations that nothing wanted needs.

    Raises:
        FormulaError: the formula does something that cannot be recorded; names file and line.
    """
    graph = Graph()
    slots = tuple(Slot(name, leaf, rate) for name, (leaf, rate) in inputs.items())
    states = tuple(Slot(name, leaf) for name, leaf in state.items())
    wanted = tuple(Slot(name, leaf, rate) for name, (leaf, rate) in outputs.items())
    try:
        new_state, results = step(
            {s.name: _declare(graph, replace(s, name=f"state.{s.name}")) for s in states},
            {s.name: _declare(graph, s) for s in slots},
        )
        state_nodes = [n for s in states for n in _nodes(graph, s, new_state)]
        output_nodes = [_nodes(graph, s, results) for s in wanted]
    except FormulaError:
        raise
    except _NUMPY_S as error:
        raise located(error) from error
    program = assemble(graph, slots, states, wanted, state_nodes, output_nodes)
    if program.operations > LARGEST:
        raise FormulaError(
            f"the formula has {program.operations} operations; a kernel has at most {LARGEST}",
            next_step="shorten its longest loop (iterations, sigma points) or split the method",
        )
    return program


def _nodes(graph: Graph, slot: Slot, values: Mapping[str, Any]) -> list[int]:
    if slot.name not in values:
        raise UsageError(f"the formula has no output {slot.name!r}; it has {sorted(values)}")
    found = [graph.lift(v) for v in slot.leaf.flatten(values[slot.name])]
    for v in found:
        if v is None or graph.is_bool(v.index):
            raise FormulaError(
                f"{slot.name!r} is not made of numbers",
                next_step="give floats or recorded numbers; select(condition, 1.0, 0.0) is one",
            )
    return [v.index for v in found if v is not None]


def assemble(
    graph: Graph,
    inputs: tuple[Slot, ...],
    state: tuple[Slot, ...],
    outputs: tuple[Slot, ...],
    state_nodes: list[int],
    output_nodes: list[list[int]],
) -> Program:
    """Drop what nothing needs, renumber, and find how often each node must be computed."""
    needed = set(state_nodes).union(*output_nodes)
    for i in range(len(graph.nodes) - 1, -1, -1):
        op, args = graph.nodes[i]
        if i in needed and op not in ("const", "input"):
            needed.update(args)
    order = sorted(needed)
    number = {old: new for new, old in enumerate(order)}
    declared = {s.name: int(s.rate) for s in inputs}  # flags are slow to combine
    nodes: list[tuple[str, tuple[Any, ...]]] = []
    rates: list[int] = []
    for old in order:
        op, args = graph.nodes[old]
        rate = 0
        if op == "input":
            rate = declared.get(args[0], 3)
        elif op != "const":
            args = tuple([number[a] for a in args])
            for a in args:
                rate |= rates[a]
        nodes.append((op, args))
        rates.append(rate)
    return Program(
        tuple(nodes),
        tuple([_RATES[rate] for rate in rates]),
        inputs,
        state,
        outputs,
        tuple(number[n] for n in state_nodes),
        tuple(tuple(number[n] for n in numbers) for numbers in output_nodes),
    )


def is_condition(op: str) -> bool:
    """Whether an operation yields a condition rather than a number."""
    return op in COMPARISONS

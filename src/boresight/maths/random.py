"""Random numbers as formulas: made where they are used, in a kernel or in NumPy, and never stored.

A number is a function of a key (the user's seed and the name of a cell) and of a counter: the run,
the step, the pair it belongs to and what it is for. So any number of any run can be made again by
itself, and every contender of a study makes the same ones.

[salmon2011] J. K. Salmon et al., "Parallel Random Numbers: As Easy as 1, 2, 3", for the bits;
[box1958] G. E. P. Box, M. E. Muller, "A Note on the Generation of Random Normal Deviates", for
normal numbers. Differs from the second: the angle is reduced to an eighth of a turn while still in
turns, which is exact.
"""

import hashlib
from typing import Any

import numpy as np

from boresight.lanes import copysign, near_zero, random_pair, select

Array = Any
Key = tuple[Any, Any]
LARGEST = 2**32 - 1  # run, step or stream


def key(seed: int, cell: str) -> Key:
    """Two words, whole numbers below 2^32, of a seed (0 to 2^64 - 1) and the name of a cell."""
    text = seed.to_bytes(8, "little") + cell.encode()
    digest = hashlib.blake2b(text, digest_size=8).digest()
    return float(int.from_bytes(digest[:4], "little")), float(int.from_bytes(digest[4:], "little"))


def uniforms(key: Key, run: Any, step: Any, stream: int, count: int) -> Array:
    """Numbers of 52 bits, evenly distributed over (0, 1), never 0 nor 1.

    Args:
        key: from `key`, or two inputs of a kernel.
        run: number of the run, 0 to 2^32 - 1: a float, a symbol, or an array.
        step: number of the step, likewise; arrays broadcast.
        stream: what the numbers are for; a stream is of uniform or of normal numbers, not of both.
        count: how many.

    Returns:
        (count,), or (count, ...) of arrays.
    """
    return _first(count, [pair(key, run, step, stream, i) for i in range((count + 1) // 2)])


def normals(key: Key, run: Any, step: Any, stream: int, count: int) -> Array:
    """Standard normal numbers, of magnitudes up to 8.57; arguments as of `uniforms`."""
    blocks = (pair(key, run, step, stream, i) for i in range((count + 1) // 2))
    return _first(count, [normal_pair(*block) for block in blocks])


def pair(key: Key, run: Any, step: Any, stream: Any, number: Any) -> tuple[Any, Any]:
    """Two uniform numbers: those at 2 `number` and beside it."""
    return random_pair((run, step, number, stream), key)


def normal_pair(u: Any, v: Any) -> tuple[Any, Any]:
    """Two independent normal numbers of two uniform ones: radius by u, angle of v turns."""
    radius = np.sqrt(-2.0 * np.log(u))
    half = v - 0.5
    off = 0.25 - abs(half)  # turns; its sine is less the angle's cosine
    near = abs(off)
    steep = near > 0.125
    sine, cosine = near_zero(2.0 * np.pi * select(steep, 0.25 - near, near))
    # Signs come last, so that no addition outside fuses with the product: same bits everywhere.
    x = copysign(radius * select(steep, cosine, sine), -off)
    return x, copysign(radius * select(steep, sine, cosine), -half)


def _first(count: int, pairs: list[tuple[Any, Any]]) -> Array:
    return np.array([number for two in pairs for number in two][:count])

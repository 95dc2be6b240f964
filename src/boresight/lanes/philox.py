"""Random bits as a function: Philox4x32-10 in NumPy, what compiled code does in `writer`.

[salmon2011] J. K. Salmon et al., "Parallel Random Numbers: As Easy as 1, 2, 3": a counter of four
words, scrambled by ten rounds under a key of two, is a block of four random words. Ours are held as
doubles, and a block is given as two numbers of 52 bits in (0, 1), since that is what formulas take.
"""

from typing import Any

import numpy as np

Array = Any
ROUNDS = 10
MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
KEY_STEPS = (0x9E3779B9, 0xBB67AE85)
COST = 60  # operations of half a block: 10 rounds of 10, and 20 from and to doubles
_LOW = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)


def philox(*words: Array) -> tuple[Array, Array]:
    """The two numbers of a block.

    Args:
        words: four of the counter and two of the key, whole numbers below 2^32; they broadcast.
    """
    a, b, c, d, key, other = (np.asarray(word).astype(np.uint64) for word in words)
    for _ in range(ROUNDS):
        p, q = a * np.uint64(MULTIPLIERS[0]), c * np.uint64(MULTIPLIERS[1])
        a, b, c, d = (q >> _HALF) ^ b ^ key, q & _LOW, (p >> _HALF) ^ d ^ other, p & _LOW
        key, other = (
            (k + np.uint64(s)) & _LOW for k, s in zip((key, other), KEY_STEPS, strict=True)
        )
    return _number(a, b), _number(c, d)


def _number(high: Array, low: Array) -> Array:
    """The middle of one of 2^52 equal parts of (0, 1): never 0 nor 1, and exact."""
    bits = (high << np.uint64(20)) | (low >> np.uint64(12))
    return (bits + 0.5) * 2.0**-52

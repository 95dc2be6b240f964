"""Random bits of compiled code: the published answers, and the same bits on every back end."""

import numpy as np
import pytest

from boresight.errors import FormulaError
from boresight.lanes import Rate, Scalar, Vector, pack_states, random_pair, trace
from boresight.lanes.elementary import lower
from boresight.lanes.ir import write_ir
from boresight.lanes.philox import COST
from boresight.lanes.writer import Shape
from lanes.machines import evaluate, kernel_for, record, targets

TOP = 2**32 - 1
# Counter, key and answer of philox4x32-10, from the Random123 library's table of known answers.
PUBLISHED = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((TOP,) * 4, (TOP,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]


def half(which):
    """One number of a block, as a formula of six words."""
    return lambda *words: random_pair(words[:4], words[4:])[which]


def numbers(answer):
    """The two numbers that four words make, in whole numbers: the middles of 2^52 parts of 1."""
    a, b, c, d = answer
    return [((high * 2**20 + low // 2**12) * 2 + 1) / 2**53 for high, low in ((a, b), (c, d))]


def words(count):
    """Counters and keys, the extreme words among them, (6, count)."""
    found = np.random.default_rng(1).integers(0, 2**32, (6, count)).astype(float)
    found[:, :2] = [[0.0, TOP]] * 6
    return found


@targets
@pytest.mark.parametrize(("counter", "key", "answer"), PUBLISHED)
def test_published_answers(goal, counter, key, answer):
    given = [float(word) for word in (*counter, *key)]
    got = [evaluate(half(i), goal, *([word] for word in given))[0] for i in (0, 1)]
    assert got == numbers(answer)
    assert [float(x) for x in random_pair(tuple(given[:4]), tuple(given[4:]))] == numbers(answer)


@targets
@pytest.mark.parametrize("which", [0, 1])
def test_every_back_end_has_the_bits_of_numpy(goal, which):
    """1,001 lanes, so the last block is not full."""
    given = words(1_001)
    assert np.array_equal(evaluate(half(which), goal, *given), half(which)(*given))


@targets
@pytest.mark.parametrize("rates", ["FFSSLE", "LSFFFF", "SSSSFF", "LLLLLL", "ELSFEL", "FFFFFF"])
def test_words_may_change_at_any_rate(goal, rates):
    """What changes less often is made outside the loop, by scalars: the same numbers."""
    lanes, steps, kinds = 11, 3, {"F": Rate.FIXED, "S": Rate.STEP, "L": Rate.LANE, "E": Rate.EACH}
    leading = {"F": (), "S": (steps,), "L": (lanes,), "E": (lanes, steps)}
    spread = {"F": (1, 1), "S": (1, steps), "L": (lanes, 1), "E": (lanes, steps)}
    rng = np.random.default_rng(2)
    values = [rng.integers(0, 2**32, leading[r]).astype(float) for r in rates]

    def step(state, inputs):
        pair = random_pair(
            *[tuple(inputs[f"w{i}"] for i in part) for part in ([0, 1, 2, 3], [4, 5])]
        )
        return state, {"pair": np.array(pair)}

    program = trace(
        step,
        state={"idle": Scalar()},
        inputs={f"w{i}": (Scalar(), kinds[r]) for i, r in enumerate(rates)},
        outputs={"pair": (Vector(2), Rate.EACH)},
    )
    start = pack_states(program.state, {"idle": np.zeros(lanes)})
    given = {f"w{i}": v for i, v in enumerate(values)}
    got = kernel_for(program, goal).run(start, given, steps)[1]["pair"]
    wide = [np.reshape(v, spread[r]) for v, r in zip(values, rates, strict=True)]
    assert np.array_equal(got, np.broadcast_to(np.stack(half_pair(wide), -1), got.shape))


def half_pair(wide):
    return random_pair(tuple(wide[:4]), tuple(wide[4:]))


def test_what_is_known_when_recorded_is_a_constant():
    counter, key, answer = PUBLISHED[2]
    program = record(lambda x: x + half(1)(*[x * 0.0 + word for word in (*counter, *key)]), 1)
    assert program.operations == 1
    assert repr(numbers(answer)[1]) in str(program)


def test_a_block_is_made_once_for_both_its_numbers():
    program = record(lambda *w: half(0)(*w) + half(1)(*w), 6)
    text = write_ir(lower(program, rounding=True), Shape(8, rows=True), "kernel", "")
    assert text.count("splat (i64 3528531795)") == 10  # once a round: the first multiplier
    assert program.operations == 2 * COST + 1


def test_an_array_beside_a_recorded_number_is_refused():
    with pytest.raises(FormulaError, match="array"):
        record(lambda x: half(0)(x, np.arange(3.0), 0, 0, 0, 0), 1)

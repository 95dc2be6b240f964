"""Sums over runs: whatever the chunks and their order, the same bits."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.laboratory.scores import Node
from boresight.laboratory.sums import Tree, cover


def runs_of(place):
    level, index = place
    return list(range(index << level, (index + 1) << level))


@given(st.integers(0, 10_000), st.integers(1, 5_000), st.integers(0, 20))
def test_a_cover_holds_every_run_once_in_order(first, count, highest):
    places = cover(first, count, highest=highest)
    assert [run for place in places for run in runs_of(place)] == [*range(first, first + count)]
    assert max(level for level, _ in places) <= highest


@given(st.integers(0, 10_000), st.integers(1, 5_000))
def test_a_cover_has_as_few_nodes_as_can_be(first, count):
    places = cover(first, count)
    assert len(set(places)) == len(places)
    for (level, index), (after, beside) in pairwise(places):
        halves_of_one = level == after and index % 2 == 0 and beside == index + 1
        assert not halves_of_one


def values(runs):
    """Numbers whose sum depends on the order in which they are added."""
    rng = np.random.default_rng(3)
    return rng.normal(size=(runs, 2)) * 10.0 ** rng.integers(-8, 8, (runs, 2))


def recursive(x):
    """The tree's sum, written as what it is: of the largest power of two, and of the rest."""
    if len(x) == 1:
        return x[0]
    half = 1 << (len(x) - 1).bit_length() - 1
    return recursive(x[:half]) + recursive(x[half:])


def chunk(x, first, count):
    """Its nodes, as a chunk would give them."""
    return [Node(*place, {"x": recursive(x[runs_of(place)])}) for place in cover(first, count)]


@given(st.integers(1, 300), st.data())
def test_chunks_of_any_size_in_any_order_give_the_same_bits(runs, data):
    x = values(runs)
    cuts = sorted(data.draw(st.sets(st.integers(1, max(1, runs - 1)), max_size=20)) - {runs})
    ends = zip([0, *cuts], [*cuts, runs], strict=True)
    chunks = data.draw(st.permutations([(a, b - a) for a, b in ends if b > a]))
    tree = Tree()
    for first, count in chunks:
        tree.add(chunk(x, first, count))
    assert [(node.level, node.index) for node in tree.nodes] == cover(0, runs)
    assert np.array_equal(tree.total["x"], recursive(x))


@pytest.mark.parametrize("size", [1, 7, 100, 4096])
def test_chunks_of_one_size_give_the_bits_of_one_chunk(size):
    x = values(1_000)
    tree = Tree(
        node
        for first in range(0, 1_000, size)
        for node in chunk(x, first, min(size, 1_000 - first))
    )
    assert np.array_equal(tree.total["x"], recursive(x))
    assert not np.array_equal(np.add.reduce(x), recursive(x))  # the order matters here


def test_half_of_the_runs_is_kept_until_the_rest_comes():
    x = values(8)
    tree = Tree([*chunk(x, 6, 2), *chunk(x, 1, 2)])
    assert [(node.level, node.index) for node in tree.nodes] == [(0, 1), (0, 2), (1, 3)]

"""The blocks of one chunk decoded, each source in its own edition.

A block is taken as undamaged when its records fill it exactly in its source's edition and each
names its source.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.formats import blocks
from boresight.formats.asterix import Records, decode
from boresight.formats.blocks import Region
from boresight.formats.plausible import Choice, choose
from boresight.formats.specs import Edition, categories
from boresight.formats.wire import Flags, Integers, Octets

_FEW = 16  # sources of a category whose edition is looked for one by one
_ODD = 0.5  # share of records without a source below which those are damage, not habit


class Batch(NamedTuple):
    """Records of one category and edition out of one chunk; `base` + start is the file offset."""

    records: Records
    base: int


@dataclass(slots=True)
class Account:
    """What reading has found so far; complete once the stream is exhausted."""

    bytes: int = 0
    framing: str = ""
    skipped: int = 0
    trailing: int = 0
    damaged: list[dict[str, object]] = field(default_factory=list)
    damaged_places: int = 0
    unknown: Counter[int] = field(default_factory=Counter)
    counts: Counter[str] = field(default_factory=Counter)
    editions: dict[tuple[int, int], Choice] = field(default_factory=dict)
    good: set[int] = field(default_factory=set)
    decoded: int = 0


class Chunk(NamedTuple):
    """Octets of a file from `base` on, the blocks found in them and what lies between those."""

    octets: Octets
    base: int
    starts: Integers
    ends: Integers
    gaps: list[Region]

    def until(self, end: int) -> "Chunk":
        """Return what lies whole before an offset."""
        keep = self.ends <= end
        gaps = [gap for gap in self.gaps if gap.end <= end]
        return Chunk(self.octets, self.base, self.starts[keep], self.ends[keep], gaps)


def decode_chunk(part: Chunk, account: Account) -> tuple[list[Batch], Flags]:
    """Decode the blocks of a chunk; return the records and which blocks were good.

    Blocks of categories that are not read count as good here.
    """
    batches: list[Batch] = []
    is_good = np.ones(len(part.starts), bool)
    kinds = part.octets[part.starts] if len(part.starts) else np.empty(0, np.uint8)
    for category in categories():
        mine = np.flatnonzero(kinds == category)
        for rows, records in _by_edition(part, mine, category, account) if len(mine) else ():
            kept, good = _without_nameless(records)
            is_good[rows] = good
            batches.append(Batch(kept, part.base))
            account.good.update(np.unique(_keys(category, part, rows[good])).tolist())
    return batches, is_good


def _keys(category: int, part: Chunk, rows: NDArray[np.intp]) -> Integers:
    return category << 16 | sources(part.octets, part.starts[rows])


def sources(octets: Octets, starts: Integers) -> NDArray[np.int64]:
    """Return SAC * 256 + SIC of each block's first record, -1 where it does not begin with one."""
    at = starts + blocks.HEADER
    has_source = octets.take(at, mode="clip") >= 128
    more = np.ones(len(at), bool)
    for _ in range(8):
        more &= (octets.take(at, mode="clip") & 1).astype(bool)
        at = at + more
    code = octets.take(at + 1, mode="clip").astype(np.int64) << 8
    return np.where(has_source, code | octets.take(at + 2, mode="clip"), -1)


def _by_edition(
    part: Chunk, mine: NDArray[np.intp], category: int, account: Account
) -> Iterator[tuple[NDArray[np.intp], Records]]:
    """Decode blocks of one category, each source in its own edition."""
    codes = sources(part.octets, part.starts[mine])
    editions = _editions(part, mine, codes, category, account)
    for edition in dict.fromkeys(editions.values()):
        wanted = [code for code, its in editions.items() if its is edition]
        rows = mine[np.isin(codes, wanted)]
        records = decode(part.octets, part.starts[rows], part.ends[rows], edition)
        if not records.is_good.all():
            records = _second_thought(part, rows, records, account)
        yield rows, records


def _editions(
    part: Chunk, mine: NDArray[np.intp], codes: Integers, category: int, account: Account
) -> dict[int, Edition]:
    """Return the edition of each source; rare ones (often damage) share the commonest one's."""
    found, counts = np.unique(codes, return_counts=True)
    by_count = [int(code) for code in found[np.argsort(-counts, kind="stable")]]
    known = account.editions
    for code in by_count[:_FEW]:
        if (category, code) not in known:
            rows = mine[codes == code]
            known[category, code] = choose(
                part.octets, part.starts[rows], part.ends[rows], category
            )
    default = known[category, by_count[0]].edition
    return {
        code: known[category, code].edition if (category, code) in known else default
        for code in by_count
    }


def _second_thought(
    part: Chunk, rows: NDArray[np.intp], records: Records, account: Account
) -> Records:
    """Read blocks again where another edition makes sense of those that this one cannot read."""
    category = records.edition.category
    bad = rows[~records.is_good]
    choice = choose(part.octets, part.starts[bad], part.ends[bad], category)
    if choice.edition is records.edition or not choice.score:
        return records
    again = decode(part.octets, part.starts[rows], part.ends[rows], choice.edition)
    if again.is_good.sum() <= records.is_good.sum():
        return records
    for code in np.unique(sources(part.octets, part.starts[rows])).tolist():
        account.editions[category, code] = choice
    return again


def _without_nameless(records: Records) -> tuple[Records, Flags]:
    """Drop blocks with a record that names no source, where most records do."""
    good = records.is_good.copy()
    nameless = ~records.has("010")
    if 0 < nameless.sum() < _ODD * len(records):
        good[records.block[nameless]] = False
        records = records.take(good[records.block])
    return records, good

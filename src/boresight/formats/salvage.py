"""What damage hides: blocks of known sources between, inside and across what could not be read.

A wrong length swallows good blocks, and so does a header of another category that chance made up.
So everything that is not a good block, blocks of categories that are not read included, is searched
for blocks of a source that was read elsewhere, whose records fill them exactly.
"""

from bisect import bisect_right
from typing import NamedTuple

import numpy as np

from boresight.formats import blocks
from boresight.formats.asterix import Records, decode
from boresight.formats.blocks import Region
from boresight.formats.decoding import Account, Batch, Chunk, sources
from boresight.formats.specs import Edition, categories
from boresight.formats.wire import Flags, Integers


class Salvage(NamedTuple):
    """Records found in damaged places, the damage that is left, and blocks of other categories."""

    batches: list[Batch]
    damage: list[Region]
    unknown: list[int]


def salvage(part: Chunk, batches: list[Batch], is_good: Flags, account: Account) -> Salvage:
    """Search whatever is not a good block of a category that is read.

    A block cut short takes the next one's first octets for its own and may still be filled
    exactly; what follows then is no block. So a good block before damage is searched too, and
    gives way to a block that begins inside it: chance does not make up a header, a known source
    and records that fit.
    """
    damaged = _joined([*_bad(part, is_good), *part.gaps, *_unknown(part)])
    if not damaged:
        return Salvage([batch for batch in batches if len(batch.records)], [], [])
    suspects = _before(part, is_good, damaged)
    places = _joined([*damaged, *suspects])
    found, spans = _rescue(part, places, account)
    unknown = [region for region in _unknown(part) if not _is_touched(region, spans)]
    kept = sorted([*spans, *((region.start, region.end) for region in unknown)])
    batches = [_outside(batch, suspects) for batch in batches]
    return Salvage(
        [batch for batch in [*batches, *found] if len(batch.records)],
        [_explained(region, damaged) for region in _without(places, kept)],
        [int(part.octets[region.start]) for region in unknown],
    )


def _explained(left: Region, damaged: list[Region]) -> Region:
    """Give what is left over the reason of the damage in it; a suspect's own, if there is none."""
    index = bisect_right(damaged, left.start, key=lambda region: region.end)
    is_there = index < len(damaged) and damaged[index].start < left.end
    return left._replace(reason=damaged[index].reason) if is_there else left


def calm_end(part: Chunk, is_good: Flags, end: int) -> int:
    """Return the offset before damage that reaches `end`, with the good block before it.

    Only so much is put off to the next buffer as the longest block could need.
    """
    at = end
    for region in reversed(_joined([*_bad(part, is_good), *part.gaps, *_unknown(part)])):
        if region.end != at or end - region.start > blocks.LARGEST:
            break
        at = region.start
    if at == end:
        return end
    before = part.starts[part.ends == at]
    return int(before[0]) if len(before) else at


def _before(part: Chunk, is_good: Flags, damaged: list[Region]) -> list[Region]:
    """Return the good blocks that damage follows directly."""
    at = np.array([region.start for region in damaged])
    known = np.isin(part.octets[part.starts], categories()) & is_good
    return [
        Region(int(part.starts[i]), int(part.ends[i]), "a block holds the start of another")
        for i in np.flatnonzero(known & np.isin(part.ends, at))
    ]


def _outside(batch: Batch, regions: list[Region]) -> Batch:
    """Leave out the records in some regions, in order."""
    first = np.array([region.start for region in regions], np.int64)
    last = np.array([region.end for region in regions], np.int64)
    index = np.searchsorted(first, batch.records.start, side="right") - 1
    inside = (index >= 0) & (batch.records.start < last[index]) if len(first) else index >= 0
    return Batch(batch.records.take(~inside), batch.base) if inside.any() else batch


def _bad(part: Chunk, is_good: Flags) -> list[Region]:
    return [
        Region(
            int(part.starts[index]),
            int(part.ends[index]),
            f"the records of a block of category {part.octets[part.starts[index]]} do not fill it",
        )
        for index in np.flatnonzero(~is_good)
    ]


def _unknown(part: Chunk) -> list[Region]:
    """Return the blocks of categories that are not read, which chance may have made up."""
    if not len(part.starts):
        return []
    kinds = part.octets[part.starts]
    return [
        Region(
            int(part.starts[index]),
            int(part.ends[index]),
            f"a block of category {kinds[index]} holds whole blocks of others",
        )
        for index in np.flatnonzero(~np.isin(kinds, categories()))
    ]


def _joined(regions: list[Region]) -> list[Region]:
    """Join regions that touch, in the order of the file; the first one's reason stays."""
    joined: list[Region] = []
    for region in sorted(regions):
        if joined and region.start <= joined[-1].end:
            end = max(joined[-1].end, region.end)
            joined[-1] = joined[-1]._replace(end=end)
        else:
            joined.append(region)
    return joined


def _rescue(
    part: Chunk, places: list[Region], account: Account
) -> tuple[list[Batch], list[tuple[int, int]]]:
    """Decode the blocks of known sources that lie whole inside places; return where they lie."""
    batches: list[Batch] = []
    spans: list[tuple[int, int]] = []
    for category in categories() if places else ():
        starts, ends = blocks.candidates(part.octets, places, category)
        codes = sources(part.octets, starts)
        for code in np.unique(codes).tolist():
            mine = codes == code
            choice = account.editions.get((category, code))
            if choice is not None and category << 16 | code in account.good:
                records = _whole(part, starts[mine], ends[mine], choice.edition)
                chosen = np.unique(records.block)
                found = starts[mine][chosen].tolist(), ends[mine][chosen].tolist()
                spans += zip(*found, strict=True)
                batches.append(Batch(records, part.base))
    return batches, sorted(spans)


def _whole(part: Chunk, starts: Integers, ends: Integers, edition: Edition) -> Records:
    """Decode candidates; keep those that name sources throughout and do not overlap."""
    records = decode(part.octets, starts, ends, edition)
    good = records.is_good.copy()
    good[records.block[~records.has("010")]] = False
    index = np.flatnonzero(good)
    kept = np.zeros(len(good), bool)
    kept[index[blocks.last_of_overlapping(starts[index], ends[index])]] = True
    return records.take(kept[records.block])


def _is_touched(region: Region, spans: list[tuple[int, int]]) -> bool:
    """Tell whether one of some spans, in order, overlaps a region."""
    index = bisect_right(spans, region.start, key=lambda span: span[1])
    return index < len(spans) and spans[index][0] < region.end


def _without(places: list[Region], spans: list[tuple[int, int]]) -> list[Region]:
    """Cut spans, in order, out of places, in order."""
    left: list[Region] = []
    following = iter([*spans, (np.inf, np.inf)])
    first, last = next(following)
    for start, end, reason in places:
        at = start
        while first < end:
            if first > at:
                left.append(Region(at, int(first), reason))
            at = max(at, int(last))
            first, last = next(following)
        if at < end:
            left.append(Region(at, end, reason))
    return left

"""What target motion analysis puts on the page: each contact, what is known of it and what not."""

from typing import TYPE_CHECKING

from boresight.interfaces.report.sections import Block, Part, Tile
from boresight.interfaces.report.tma_verdict import sentences
from boresight.interfaces.report.tma_words import KINDS, estimate, region

if TYPE_CHECKING:
    from boresight.tma.result import TargetMotion, TmaResult


def part(result: "TmaResult") -> Part:
    """Return the part of the page about target motion."""
    motion = result.main
    return Part(
        kind="target motion",
        title=f"Contact {motion.contact.name}",
        subject="The contacts",
        tiles=_tiles(motion),
        sentences=sentences(motion),
        remarks=(*result.remarks, *motion.contact.remarks, *motion.remarks),
        blocks=(Block("picture", "Picture", ""),),
        settings=("How it was analysed", motion.settings),
        charts={},
        series=None,
        facts={},
    )


def _tiles(motion: "TargetMotion") -> tuple[Tile, ...]:
    found = []
    for kind in KINDS:
        quantity = getattr(motion, kind.name)
        within = region(kind, quantity)
        found.append(Tile(kind.stem, estimate(kind, quantity), f"90 %: {within}" if within else ""))
    return tuple(found)

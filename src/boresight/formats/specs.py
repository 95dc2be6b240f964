"""The layouts of ASTERIX items, as the committed table states them.

The table is made from libasterix's specifications by `scripts/build_asterix_tables.py`, whose
docstring describes it. Read once, at first use.
"""

import json
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from boresight.errors import UsageError

ShapeKind = Literal["fixed", "extended", "repetitive", "fx", "explicit", "compound"]


@dataclass(frozen=True, slots=True)
class Field:
    """Some bits of an item: `offset` counts from the item's first bit, FX bits included."""

    name: str
    offset: int
    width: int
    kind: str
    lsb: float = 1.0
    unit: str = ""

    @property
    def is_signed(self) -> bool:
        """Two's complement."""
        return self.kind in "iQ"

    @property
    def is_quantity(self) -> bool:
        """A number times `lsb`, in `unit`."""
        return self.kind in "qQ"


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """How one item lies on the wire; what the fields mean depends on `kind`.

    Attributes:
        kind: one of six.
        size: octets of a fixed item, or of one repetition.
        parts: octets of each part of an extended item.
        is_open: the last part of an extended item ends with FX, which must be zero.
        fields: the bit fields, spare ones included (kind `-`).
        slots: sub-items of a compound one, in the order of its FSPEC.
        fspec: largest number of FSPEC octets of a compound item.
    """

    kind: ShapeKind
    size: int = 0
    parts: tuple[int, ...] = ()
    is_open: bool = True
    fields: tuple[Field, ...] = field(default=(), repr=False)
    slots: tuple["Slot | None", ...] = field(default=(), repr=False)
    fspec: int = 0

    def field(self, name: str) -> Field:
        """Return the field called `name` (empty for an item that is one number)."""
        for candidate in self.fields:
            if candidate.name == name and candidate.kind != "-":
                return candidate
        raise KeyError(name)


@dataclass(frozen=True, slots=True, eq=False)
class Slot:
    """One bit of an FSPEC: an item (or sub-item) and its shape."""

    name: str
    shape: Shape


@dataclass(frozen=True, slots=True, eq=False)
class Edition:
    """One published edition of a category: its record is a compound shape, FRN by FRN."""

    category: int
    name: str
    record: Shape = field(repr=False)

    def frn(self, item: str) -> int | None:
        """Return the index (from 0) of `item` in the user application profile, if it is there."""
        for index, slot in enumerate(self.record.slots):
            if slot is not None and slot.name == item:
                return index
        return None


def categories() -> tuple[int, ...]:
    """Return the categories that can be read."""
    return tuple(int(category) for category in _table()["editions"])


@cache
def editions(category: int) -> tuple[Edition, ...]:
    """Return the published editions of `category`, oldest first; empty if it is not known."""
    return tuple(edition(category, name) for name in _table()["editions"].get(str(category), ()))


@cache
def edition(category: int, name: str) -> Edition:
    """Return one edition.

    Raises:
        UsageError: there is no such category or edition in the table.
    """
    known = _table()["editions"].get(str(category), {})
    if name not in known:
        raise UsageError(
            f"category {category} has no edition {name!r}",
            why=f"known editions: {', '.join(known) or 'none'}",
            next_step=f"name one of categories {', '.join(map(str, categories()))} and its edition",
        )
    slots = _slots(known[name])
    return Edition(category, name, Shape("compound", slots=slots, fspec=-(-len(slots) // 7)))


@cache
def _table() -> dict[str, Any]:
    text = files("boresight.formats").joinpath("asterix_items.json").read_text(encoding="ascii")
    table: dict[str, Any] = json.loads(text)
    return table


@cache
def _shape(index: int) -> Shape:
    item = _table()["items"][index]
    return Shape(
        kind=item["s"],
        size=item.get("n", 0),
        parts=tuple(item.get("p", ())),
        is_open=item.get("open", True),
        fields=tuple(Field(*field) for field in item.get("f", ())),
        slots=_slots(item.get("i", ())),
        fspec=item.get("max", 0),
    )


def _slots(entries: list[list[Any] | None]) -> tuple[Slot | None, ...]:
    return tuple(entry and Slot(entry[0], _shape(entry[1])) for entry in entries)  # type: ignore[misc]

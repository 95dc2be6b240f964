"""Build `src/boresight/formats/asterix_items.json` from the specifications inside libasterix.

Run it after a new release of libasterix (extra `test`): `python scripts/build_asterix_tables.py`.
A test compares the committed table with a rebuild. Contents:

    items     pool of wire shapes, shared by the editions:
              {"s": "fixed", "n": octets, "f": fields}
              {"s": "extended", "p": octets of the parts, "open": FX ends the last, "f": fields}
              {"s": "repetitive", "n": octets of one, "f": fields}         one count octet before
              {"s": "fx", "n": octets of one, FX included, "f": fields}    repeats while FX is set
              {"s": "explicit"}                                            own length in octet one
              {"s": "compound", "max": FSPEC octets, "i": slots}
    editions  category -> edition -> slots of the UAP, in order of FRN
    slot      [item id, index into the pool], or null for a spare one
    field     [name, bit offset from the item's first bit, width, kind, lsb, unit]

Kinds: `r` raw, `t` enumeration, `u`/`i` integer without/with sign, `q`/`Q` quantity without/with
sign (lsb and unit follow), `a` ASCII, `c` six-bit characters, `o` octal, `b` BDS register, `-`
spare. A content that depends on another field is kept raw.
"""

import json
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

from asterix import base, generated

CATEGORIES = (10, 21, 34, 48, 62)
TARGET = Path(__file__).parents[1] / "src" / "boresight" / "formats" / "asterix_items.json"
STRINGS = {base.StringAscii: "a", base.StringICAO: "c", base.StringOctal: "o"}


def build() -> dict[str, Any]:
    """Return the whole table as plain lists and dictionaries."""
    pool = Pool()
    editions = {
        str(category): {
            ".".join(map(str, spec.cv_edition)): [
                slot(pool, entry) for entry in spec.cv_uap.cv_record.cv_items_list
            ]
            for spec in generated.manifest["CATS"][category]
        }
        for category in CATEGORIES
    }
    return {
        "about": "Layouts of ASTERIX items, derived from the specifications in libasterix (MIT).",
        "libasterix": version("libasterix"),
        "specifications": f"{generated.asterix_specs_ref} of {generated.asterix_specs_date}",
        "editions": editions,
        "items": pool.items,
    }


class Pool:
    """Items met so far, each kept once."""

    def __init__(self) -> None:
        self.items: list[Any] = []
        self._index: dict[str, int] = {}

    def add(self, item: dict[str, Any]) -> int:
        """Return the index of `item`, which is stored if it is new."""
        key = json.dumps(item)
        if key not in self._index:
            self._index[key] = len(self.items)
            self.items.append(item)
        return self._index[key]


def slot(pool: Pool, entry: Any) -> list[Any] | None:
    """Return one FRN of a UAP."""
    if issubclass(entry, base.UapItemSpare):
        return None
    if issubclass(entry, base.UapItemRFS):
        raise NotImplementedError("random field sequencing: no edition of these categories has it")
    return named(pool, entry.cv_non_spare)


def named(pool: Pool, non_spare: Any) -> list[Any]:
    """Return [name, index] of an item or sub-item."""
    return [non_spare.cv_name, pool.add(shape(pool, variation(non_spare)))]


def variation(non_spare: Any) -> Any:
    """Return the one variation of an item; a dependent one has no place in these categories."""
    rule = non_spare.cv_rule
    if issubclass(rule, base.RuleVariationDependent):
        raise NotImplementedError(f"{non_spare.cv_name}: the layout depends on another item")
    return rule.cv_variation


def shape(pool: Pool, var: Any) -> dict[str, Any]:
    """Return how an item lies on the wire, with the fields in it."""
    if issubclass(var, base.Explicit):
        return {"s": "explicit"}
    if issubclass(var, base.Compound):
        slots = [part and named(pool, part) for part in var.cv_items_list]
        return {"s": "compound", "max": var.cv_fspec_max_bytes, "i": slots}
    if issubclass(var, base.Extended):
        return extended(var)
    if issubclass(var, base.Repetitive):
        return repetitive(var)
    fields, size = fields_of(var, "", 0)
    return {"s": "fixed", "n": octets(size), "f": fields}


def extended(var: Any) -> dict[str, Any]:
    """Return the shape of an item whose parts follow while the bit FX is set."""
    fields, at, parts = [], 0, []
    for part in var.cv_items_list:
        start = at
        for entry in part:
            if entry is not None:
                found, at = member(entry[0], entry[1], "", at)
                fields += found
            else:
                at += 1
        parts.append(octets(at - start))
    is_open = var.cv_items_list[-1][-1] is None
    return {"s": "extended", "p": parts, "open": is_open, "f": fields}


def repetitive(var: Any) -> dict[str, Any]:
    """Return the shape of an item repeated by count, or by FX."""
    fields, size = fields_of(var.cv_variation, "", 0)
    if var.cv_rep_bytes is None:
        return {"s": "fx", "n": octets(size + 1), "f": fields}
    if var.cv_rep_bytes != 1:
        raise NotImplementedError(f"a count of {var.cv_rep_bytes} octets")
    return {"s": "repetitive", "n": octets(size), "f": fields}


def fields_of(var: Any, name: str, at: int) -> tuple[list[Any], int]:
    """Return the fields of an element or group that starts at bit `at`, and the bit after it."""
    if issubclass(var, base.Element):
        return [[name, at, var.cv_bit_size, *kind(var.cv_rule)]], at + var.cv_bit_size
    if not issubclass(var, base.Group):
        raise NotImplementedError(f"{name}: {var.__mro__[1].__name__} inside a fixed item")
    fields = []
    for entry, size in var.cv_items_list:
        found, at = member(entry, size, name, at)
        fields += found
    return fields, at


def member(entry: Any, size: int, prefix: str, at: int) -> tuple[list[Any], int]:
    """Return the fields of one entry of a group or extended part."""
    if issubclass(entry, base.Spare):
        return [["", at, size, "-"]], at + size
    inner = entry.cv_non_spare
    name = f"{prefix}/{inner.cv_name}" if prefix else inner.cv_name
    return fields_of(variation(inner), name, at)


def kind(rule: Any) -> list[Any]:
    """Return the kind of a content, with lsb and unit where it is a quantity."""
    if issubclass(rule, base.RuleContentDependent):
        return ["r"]
    content = rule.cv_content
    if issubclass(content, base.ContentQuantity):
        signed = content.cv_signedness is base.Signed
        return ["Q" if signed else "q", content.cv_lsb, content.cv_unit]
    if issubclass(content, base.ContentInteger):
        return ["i" if content.cv_signedness is base.Signed else "u"]
    if issubclass(content, base.ContentString):
        return [STRINGS[content.cv_string_type]]
    if issubclass(content, base.ContentBds):
        return ["b"]
    return ["t" if issubclass(content, base.ContentTable) else "r"]


def octets(bits: int) -> int:
    """Return whole octets; anything else would be a misread specification."""
    if bits % 8:
        raise ValueError(f"{bits} bits are not whole octets")
    return bits // 8


def dump(table: dict[str, Any]) -> str:
    """Return the table as text, one pool item a line so that a change reads well."""
    items = ",\n".join(json.dumps(item, separators=(",", ":")) for item in table["items"])
    head = {key: value for key, value in table.items() if key != "items"}
    return f'{json.dumps(head, separators=(",", ":"))[:-1]},\n"items":[\n{items}\n]}}\n'


def main() -> int:
    """Write the table."""
    TARGET.write_text(dump(build()), encoding="ascii")
    print(f"{TARGET.name}: {TARGET.stat().st_size} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())

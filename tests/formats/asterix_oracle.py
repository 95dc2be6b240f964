"""libasterix as a second opinion: it makes random records, and says what is in any record."""

import random
from collections import defaultdict

import pytest

base = pytest.importorskip("asterix.base", reason="libasterix (extra test) is not installed")
generated = pytest.importorskip("asterix.generated")

CATEGORIES = (10, 21, 34, 48, 62)
SPECS = {
    (category, ".".join(map(str, spec.cv_edition))): spec
    for category in CATEGORIES
    for spec in generated.manifest["CATS"][category]
}


def random_record(spec, rng: random.Random, *, least: int = 0) -> bytes:
    """Return a random record; `least` is the smallest number of sub-items and repetitions."""
    record = spec.cv_uap.cv_record
    share = rng.choice([0.1, 0.5, 0.9, 1.0])
    wanted = {
        slot.cv_non_spare.cv_name: _random_arg(slot.cv_non_spare.cv_rule.cv_variation, rng, least)
        for slot in record.cv_items_list
        if issubclass(slot, base.UapItem) and rng.random() < share
    }
    wanted.setdefault("010", rng.getrandbits(16))
    return record.create(wanted).unparse().to_bytes()


def _random_arg(variation, rng, least):
    if issubclass(variation, base.Explicit):
        return rng.randbytes(rng.randint(1, 12))
    if issubclass(variation, base.Compound):
        names = [part.cv_name for part in variation.cv_items_list if part]
        chosen = rng.sample(names, rng.randint(least, len(names)))
        rules = variation.cv_items_dict
        return {n: _random_arg(rules[n].cv_rule.cv_variation, rng, least) for n in chosen}
    if issubclass(variation, base.Extended):
        return _random_parts(variation, rng)
    if issubclass(variation, base.Repetitive):
        lowest = 1 if variation.cv_rep_bytes is None else least
        count = rng.randint(lowest, 5)
        return [_random_fixed(variation.cv_variation, rng) for _ in range(count)]
    return _random_fixed(variation, rng)


def _random_fixed(variation, rng):
    if issubclass(variation, base.Element):
        return rng.getrandbits(variation.cv_bit_size)
    return tuple(_random_member(entry, rng) for entry, _ in variation.cv_items_list)


def _random_member(entry, rng):
    if issubclass(entry, base.Spare):
        return 0
    return _random_fixed(entry.cv_non_spare.cv_rule.cv_variation, rng)


def _random_parts(variation, rng):
    """Any number of parts, the last of several never all zero: an encoder may drop that one."""
    parts = variation.cv_items_list[: rng.randint(1, len(variation.cv_items_list))]
    while True:
        args = [tuple(e and _random_member(e[0], rng) for e in part) for part in parts]
        if len(args) == 1 or _is_any_set(args[-1]):
            return args


def _is_any_set(arg):
    return any(map(_is_any_set, arg)) if isinstance(arg, tuple) else bool(arg)


def fields_of(spec, record: bytes):
    """Return path -> list of (raw, reading) of every occurrence in one record.

    The reading is a number in the specification's unit, a text, or the raw number itself.
    """
    result = spec.cv_uap.cv_record.parse(
        base.ParsingMode.StrictParsing, base.Bits.from_bytes(record)
    )
    assert not isinstance(result, ValueError), result
    parsed, rest = result
    assert len(rest) == 0
    found = defaultdict(list)
    for name, item in parsed.items_regular.items():
        _collect(item.arg.arg, name, found)
    return dict(found)


def _collect(variation, path, found):
    if isinstance(variation, base.Explicit):
        found[path].append((variation.get_bytes(), None))
    elif isinstance(variation, base.Compound):
        for name, item in variation.arg.items():
            _collect(item.arg.arg, f"{path}/{name}", found)
    elif isinstance(variation, base.Extended):
        for part in variation.arg:
            for entry in part:
                _collect_entry(entry, path, found)
    elif isinstance(variation, base.Repetitive):
        for one in variation.arg:
            _collect(one, path, found)
    elif isinstance(variation, base.Group):
        for entry in variation.arg:
            _collect_entry(entry, path, found)
    else:
        found[path].append((variation.as_uint(), _reading(variation)))


def _collect_entry(entry, path, found):
    if isinstance(entry, base.Item):
        _collect(entry.arg.arg.arg, f"{path}/{entry.cv_non_spare.cv_name}", found)


def _reading(variation):
    rule = variation._get_rule()
    if isinstance(rule, base.RuleContentDependent):
        return variation.as_uint()
    content = rule._get_content()
    if isinstance(content, base.ContentQuantity):
        return content._as_quantity()
    if isinstance(content, base.ContentInteger):
        return content.as_integer()
    if isinstance(content, base.ContentString):
        return content.as_string()
    return content.as_uint()

"""Every edition, every field: records made by libasterix are read by us, and the other way."""

import random

import numpy as np
import pytest
from asterix_oracle import SPECS, fields_of, random_record

from boresight.errors import UsageError
from boresight.formats import specs
from boresight.formats.asterix import decode
from boresight.formats.encode import encode_block, encode_blocks, encode_records
from boresight.formats.plausible import plausibility

RECORDS = 60


def paths_of(edition):
    """Every path of an edition with its field; None for an item of explicit length."""
    found = {}

    def visit(prefix, shape):
        if shape.kind == "explicit":
            found[prefix] = None
        for slot in shape.slots:
            if slot is not None:
                visit(f"{prefix}/{slot.name}" if prefix else slot.name, slot.shape)
        for field in shape.fields:
            if field.kind != "-":
                found[f"{prefix}/{field.name}" if field.name else prefix] = (shape, field)

    visit("", edition.record)
    return found


def as_blocks(category, records, per_block):
    blocks = encode_blocks(category, records, np.arange(len(records)) // per_block)
    ends = np.cumsum([len(block) for block in blocks])
    starts = ends - [len(block) for block in blocks]
    return np.frombuffer(b"".join(blocks), np.uint8), starts, ends


def read(category, name, records, per_block=7):
    return decode(*as_blocks(category, records, per_block), specs.edition(category, name))


def test_the_table_holds_every_published_edition():
    ours = {(c, e.name) for c in specs.categories() for e in specs.editions(c)}
    assert ours == set(SPECS)


@pytest.mark.parametrize(("category", "name"), SPECS)
def test_random_records_of_every_edition_are_read_as_libasterix_reads_them(category, name):
    rng = random.Random(f"{category} {name}")  # noqa: S311  (a repeatable test)
    spec = SPECS[category, name]
    records = [random_record(spec, rng) for _ in range(RECORDS)]
    ours = read(category, name, records)
    assert len(ours) == RECORDS
    assert ours.is_good.all()
    theirs = [fields_of(spec, record) for record in records]
    paths = paths_of(ours.edition)
    assert {path for fields in theirs for path in fields} <= set(paths)
    for path, place in paths.items():
        if place is None:
            expected = [fields.get(path, [(None, None)])[0][0] for fields in theirs]
            assert ours.explicit(path) == expected, path
        else:
            compare_field(ours, path, place[1], [fields.get(path, []) for fields in theirs])


def compare_field(ours, path, field, theirs):
    cells = ours.cells(path)
    assert cells.record.tolist() == [i for i, cell in enumerate(theirs) for _ in cell], path
    unsigned = cells.raw.astype(np.uint64) & np.uint64(2**field.width - 1)
    assert unsigned.tolist() == [raw for cell in theirs for raw, _ in cell], path
    firsts = [cell[0][1] if cell else None for cell in theirs]
    if field.kind in "aco":
        texts = [text.decode("latin-1") for text in ours.text(path).tolist()]
        assert [visible(text) for text in texts] == [visible(f or "") for f in firsts], path
    elif field.kind in "qQui":
        wanted = [np.nan if first is None else first for first in firsts]
        np.testing.assert_allclose(ours.value(path), wanted, rtol=1e-15, err_msg=path)


@pytest.mark.parametrize(("category", "name"), SPECS)
def test_what_we_read_we_encode_to_the_same_octets(category, name):
    rng = random.Random(f"back {category} {name}")  # noqa: S311  (a repeatable test)
    records = [random_record(SPECS[category, name], rng, least=1) for _ in range(RECORDS)]
    ours = read(category, name, records)
    columns = {}
    for path, place in paths_of(ours.edition).items():
        if place is None:
            columns[path] = ours.explicit(path)
        else:
            columns[path] = column_of(ours.cells(path), RECORDS)
    assert encode_records(category, name, columns, raw=True) == records


def visible(text):
    """Without padding: libasterix leaves out six-bit codes of no letter, we write a space."""
    return text.replace(" ", "").rstrip("\x00")


def column_of(cells, count):
    """Masked (n, k): all occurrences of a field."""
    times = np.bincount(cells.record, minlength=count)
    table = np.ma.masked_all((count, max(times.max(), 1)), np.int64)
    index = np.arange(len(cells.record)) - np.repeat(np.cumsum(times) - times, times)
    table[cells.record, index] = cells.raw
    return table if table.shape[1] > 1 else table[:, 0]


def test_an_item_past_the_end_of_its_block_makes_the_block_bad():
    record = encode_records(48, "1.32", {"010/SAC": 1, "010/SIC": 2, "220": 0xABCDEF})[0]
    good = encode_block(48, [record])
    short = bytes([48, 0, len(good) - 1]) + good[3:-1]
    buffer = np.frombuffer(good + short + good, np.uint8)
    starts = np.array([0, len(good), len(good) + len(short)])
    ends = np.array([len(good), len(good) + len(short), len(buffer)])
    ours = decode(buffer, starts, ends, specs.edition(48, "1.32"))
    assert ours.is_good.tolist() == [True, False, True]
    assert ours.block.tolist() == [0, 2]
    assert ours.raw("220").tolist() == [0xABCDEF] * 2


def test_an_fspec_bit_of_no_item_makes_the_block_bad():
    good = encode_records(21, "0.23", {"010/SAC": 1, "010/SIC": 2})[0]
    assert good == bytes([0x80, 1, 2])
    spare = bytes([0x81, 1, 1, 0x02, 1, 2])  # FRN 28 is spare in this edition
    ours = read(21, "0.23", [good, spare, good], per_block=1)
    assert ours.is_good.tolist() == [True, False, True]


def test_blocks_that_do_not_fit_count_against_an_edition():
    record = encode_records(48, "1.32", {"010/SAC": 1, "140": 5.0, "220": 7})[0]
    ours = read(48, "1.32", [record, record, record[:-1], record[:-1]], per_block=1)
    assert plausibility(ours) == 0.5


def test_quantities_and_text_are_encoded_in_the_units_of_the_specification():
    columns = {
        "010/SAC": 20,
        "040/RHO": [10.0, np.nan, 255.99],
        "040/THETA": [0.0, np.nan, 359.99],
        "070/MODE3A": ["7000", None, "0021"],
        "090/FL": [350.0, -2.25, None],
        "240": ["BAW12", "", "ÅBC".encode("ascii", "ignore").decode()],
    }
    ours = read(48, "1.32", encode_records(48, "1.32", columns))
    np.testing.assert_allclose(ours.value("040/RHO"), [10.0, np.nan, 255.99], atol=1 / 512)
    np.testing.assert_allclose(ours.value("090/FL"), [350.0, -2.25, np.nan])
    assert ours.text("070/MODE3A").tolist() == [b"7000", b"", b"0021"]
    assert ours.text("240").tolist() == [b"BAW12", b"", b"BC"]
    assert ours.has("040").tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("columns", "word"),
    [
        ({"040/RHO": 300.0}, "300"),
        ({"040/XYZ": 1}, "XYZ"),
        ({"999": 1}, "999"),
        ({"240": ["TOO-LONG!"]}, "TOO-LONG!"),
        ({"220": ["ABC"]}, "ABC"),
        ({"070/MODE3A": ["9999"]}, "9999"),
        ({"090/FL": -9000.0}, "-9000"),
    ],
)
def test_what_cannot_be_encoded_is_refused_by_name(columns, word):
    with pytest.raises(UsageError, match=word):
        encode_records(48, "1.32", columns)


def test_an_unknown_edition_is_refused():
    with pytest.raises(UsageError, match=r"no edition '9\.9'"):
        specs.edition(48, "9.9")

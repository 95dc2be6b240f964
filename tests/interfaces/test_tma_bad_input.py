"""What an analyst brings to `boresight tma`: odd tables, options in vain, several contacts."""

from pathlib import Path

import polars as pl
import pytest

from boresight.interfaces import analysing, cli, contacts, screens_tma
from boresight.target_motion.result import Quantity

EXAMPLE = Path(__file__).parents[2] / "examples" / "tma"
BEARINGS, OWN_SHIP = EXAMPLE / "bearings.csv", EXAMPLE / "own-ship.csv"


@pytest.fixture
def ask(capsys):
    def asked(bearings, *more):
        code = cli.run(["tma", str(bearings), "--own-ship", str(OWN_SHIP), *map(str, more)])
        told = capsys.readouterr()
        return code, told.out, " ".join(told.err.split())

    return asked


def saved(tmp_path, frame):
    path = tmp_path / "bearings.csv"
    frame.write_csv(path)
    return path


def two_contacts():
    """Alpha is the example's; the bearings of B, turned, are of no straight track."""
    own = pl.read_csv(BEARINGS, comment_prefix="#")
    turned = own.with_columns(bearing_deg=pl.col("bearing_deg") + 40.0)
    return pl.concat(
        [own.with_columns(track=pl.lit("Alpha")), turned.with_columns(track=pl.lit("B"))]
    )


@pytest.mark.parametrize(("mark", "said"), [(";", "semicolons"), ("\t", "tabs")])
def test_columns_that_something_else_parts_are_named(tmp_path, ask, mark, said):
    path = tmp_path / "bearings.csv"
    path.write_text(BEARINGS.read_text().replace(",", mark))
    code, _, told = ask(path)
    assert code == 65
    assert said in told


@pytest.mark.parametrize(
    ("option", "said"),
    [
        (("--sigma", 5), "standard deviation was given"),
        (("--spacing", 30), "spacing was given"),
        (("--sound-speed", 1450), "speed of sound was given"),
        (("--declination", 3), "Declination was given"),
    ],
)
def test_an_option_given_in_vain_is_told(ask, option, said):
    assert said not in ask(BEARINGS)[2]
    code, _, told = ask(BEARINGS, *option)
    assert code == 0
    assert said in told


def test_a_filter_that_no_bank_has_is_not_suggested(ask):
    code, _, told = ask(BEARINGS, "--filter", "cmkf", "--cells", 5)
    assert code == 2
    assert "rp-cmkf" not in told
    assert "rp-ekf" in told


def test_a_wrong_column_map_lists_the_files_own_columns(ask):
    code, _, told = ask(BEARINGS, "--columns", "bearing_deg=nix")
    assert code == 2
    assert "its columns: time_s, bearing_deg, sigma_deg" in told


def test_what_is_wrong_with_any_contact_shown_is_told_by_its_name(tmp_path, ask):
    code, out, told = ask(saved(tmp_path, two_contacts()))
    assert code == 0
    assert "remark: B: " in told
    assert "Alpha: " in out
    alone = ask(saved(tmp_path, two_contacts()), "--track", "B")[2]
    assert "B: " not in alone
    assert alone


def test_of_many_contacts_it_is_told_how_many_have_remarks(tmp_path):
    two = two_contacts()
    bravo = two.filter(pl.col("track") == "B")
    more = [bravo.with_columns(track=pl.lit(f"B{i}")) for i in range(screens_tma.FULL)]
    found = contacts.tma(saved(tmp_path, pl.concat([two, *more])), OWN_SHIP)
    assert f"remarks on {screens_tma.FULL + 1} more contacts" in analysing.remarks_of(found)[-1]


def region(pieces, unit):
    grid = screens_tma._region(Quantity(estimate=None, sd=None, regions={"90": pieces}), "90", unit)
    return str(grid)


def test_pieces_that_touch_in_the_digits_shown_are_one():
    assert region(((4.22, 6.37), (6.41, 8.08), (10.8, 13.0)), "m/s") == "4.2 to 8.1, 10.8 to 13.0"


def test_a_region_over_north_is_read_as_on_a_compass():
    assert region(((334.0, 378.0),), "°") == "334 to 18"
    assert region(((63.0, 65.0), (359.0, 421.0)), "°") == "63 to 65, 359 to 61"


@pytest.mark.parametrize(
    ("seconds", "said"), [(38, "38 s"), (800, "13 min 20 s"), (86_400, "24 h 0 min")]
)
def test_a_duration_is_in_units_of_its_size(seconds, said):
    assert screens_tma._lasting(seconds) == said

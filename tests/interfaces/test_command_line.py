"""The real command line, as a process: what it prints where, what it imports, how it ends."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from boresight.interfaces import cli, commands, pages

ROOT = Path(__file__).parents[2]
BARCELONA = ROOT / "../shared/data/barcelona-60nm/plots-cat048.ast"
DEMO = ROOT / "src/boresight/demo/recording.ast"
HEAVY = {"numpy", "polars", "llvmlite", "cyclopts", "scipy", "rich", "plotly", "pydantic"}

needs_barcelona = pytest.mark.skipif(
    not BARCELONA.exists(), reason="the Barcelona recording is not on this machine"
)


def boresight(*arguments, **options):
    """Run the command line; outputs as text."""
    return subprocess.run(
        [sys.executable, "-m", "boresight", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        **options,
    )


def only_object(done):
    """The one JSON object that standard output must be."""
    found, end = json.JSONDecoder().raw_decode(done.stdout)
    assert done.stdout[end:].strip() == ""
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"], ["help"], ["--version"]])
def test_the_first_page_imports_nothing_heavy(arguments):
    code = (
        "import sys; sys.argv = ['boresight', *sys.argv[1:]]\n"
        "from boresight.__main__ import main\n"
        "code = main()\n"
        "print(*sorted({name.partition('.')[0] for name in sys.modules}), file=sys.stderr)\n"
        "sys.exit(code)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True
    )
    assert done.stdout
    assert not HEAVY & set(done.stderr.split())


def test_the_static_page_tells_what_the_command_line_knows():
    known = {name: cli.app[name].help.strip() for name in cli.app if not name.startswith("-")}
    assert known == pages.COMMANDS
    page = boresight("--help").stdout
    for name, line in known.items():
        assert f"  {name} " in page
        assert line in page
    for flag in cli.FLAGS:
        assert flag in pages.OPTIONS
        assert flag in commands.EPILOGUE
    assert max(map(len, page.splitlines())) <= 80


def test_the_version_is_the_installed_one():
    from importlib.metadata import version

    assert boresight("--version").stdout == version("boresight") + "\n"


@pytest.mark.parametrize("command", list(pages.COMMANDS))
def test_every_command_has_a_page_of_help(command):
    done = boresight(command, "--help")
    assert done.returncode == 0
    assert done.stderr == ""
    assert pages.COMMANDS[command].split(":")[0].split()[0] in done.stdout


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["inspet", "x"], 2, 'Did you mean "inspect"'),
        (["track"], 2, "boresight track --help"),
        (["track", "x", "--fliter", "ekf"], 2, "--filter"),
        (["track", DEMO, "--filter", "mefk"], 2, "did you mean 'mekf'"),
        (["track", DEMO, "--site", "48.9"], 2, "--site 41.3007,2.1021,27.3"),
        (["track", DEMO, "--site", "-26.7,one,0"], 2, "three numbers"),
        (["track", DEMO, "--site", "126.7,1,0"], 2, "not a place on Earth"),
        (["track", DEMO, "--sensor", "9/9"], 2, "the recording has 0/101"),
        (["track", DEMO, "--columns", "range_m"], 2, "OURS=THEIRS"),
        (["inspect", "nowhere.ast"], 66, "nowhere.ast"),
        (["cite", "nobody"], 2, "ekf"),
        (["reproduce", "nobody"], 2, "aditya"),
    ],
)
def test_a_mistake_is_one_error_with_its_cure(arguments, code, said):
    done = boresight(*arguments)
    assert done.returncode == code
    assert done.stderr.startswith("error: ")
    assert said in done.stderr
    assert "  next: " in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_a_mistake_with_json_is_one_object_too():
    done = boresight("cite", "nobody", "--json")
    found = only_object(done)["error"]
    assert done.returncode == found["exit_code"] == 2
    assert "nobody" in found["what"]
    assert found["next_step"]


@pytest.mark.parametrize(
    ("arguments", "keys"),
    [
        (
            ["inspect", DEMO],
            "format framing bytes skipped_bytes categories addresses",
        ),
        (
            ["track", DEMO, "--site=47.8,1.4,180"],
            "plots used tracks updates filter nis_per_dof rejected outputs",
        ),
        (["reproduce", "aditya", "--runs", "20"], "claims figures seed"),
        (["cite", "mekf"], "key bibtex differs"),
    ],
)
def test_json_is_alone_and_has_its_keys(arguments, keys):
    done = boresight(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    assert set(keys.split()) <= set(only_object(done))


def test_the_demo_needs_nothing_and_writes_where_it_stands(tmp_path):
    done = boresight("demo", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = only_object(done)
    assert {"plots", "used", "tracks", "updates", "nis_per_dof", "report"} <= set(found)
    assert {"pairs", "targets", "terms", "noise", "air_gain_m_per_km"} <= set(found)
    names = {each["filter"] for each in found["comparisons"]}
    assert names == {"ekf", "mekf", "mekf, calibrated"}
    page = (tmp_path / found["report"]).read_text(encoding="utf-8")
    assert "Against the known truth" in page
    assert "boresight demo --json" in page
    assert hashlib.sha256(DEMO.read_bytes()).hexdigest() in page


def test_options_of_every_command_stand_anywhere_but_behind_the_end_of_options():
    before = boresight("--json", "cite", "ekf")
    assert only_object(before) == only_object(boresight("cite", "ekf", "--json"))
    behind = boresight("inspect", "--", "--json")
    assert behind.returncode == 66
    assert "--json" in behind.stderr


@pytest.fixture(scope="module")
def screens():
    """The screen of `track` at 80 columns, and at 120 columns without remarks."""
    colours = {"TERM": "xterm-256color"}
    return {
        80: boresight("track", DEMO, env=os.environ | colours | {"COLUMNS": "80"}),
        120: boresight("track", DEMO, "--quiet", env=os.environ | colours | {"COLUMNS": "120"}),
    }


def test_quiet_leaves_standard_error_empty(screens):
    assert "remark: " in screens[80].stderr
    assert screens[120].stderr == ""
    assert screens[120].stdout


@pytest.mark.parametrize("width", [80, 120])
def test_screens_keep_to_their_width_and_to_plain_text_where_nobody_looks(screens, width):
    said = screens[width].stdout
    assert width - 25 <= max(map(len, said.splitlines())) <= width
    assert "\x1b[" not in said + screens[width].stderr


def test_debug_shows_the_traceback_and_keeps_the_code():
    done = boresight("inspect", "nowhere.ast", "--debug")
    assert "Traceback" in done.stderr
    assert done.returncode == 66


def test_track_writes_tables_and_report(tmp_path):
    import polars as pl

    folder = tmp_path / "a folder" / "result"
    done = boresight("track", DEMO, "--site", "47.8,1.4,180", "-o", folder, "--json")
    found = only_object(done)
    names = {"report.html", "tracks.parquet", "tracks.csv", "tracks.geojson"}
    assert {Path(path).name for path in found["outputs"]} == names
    assert {path.name for path in folder.iterdir()} == names
    tracks = pl.read_parquet(folder / "tracks.parquet")
    assert tracks["track"].n_unique() == found["tracks"]
    assert len(pl.read_csv(folder / "tracks.csv", comment_prefix="#")) == len(tracks)
    shapes = json.loads((folder / "tracks.geojson").read_text())
    assert len(shapes["features"]) == found["tracks"]


def plots_alone(recording):
    """The CAT048 blocks of a raw recording: without CAT034 nobody says where the radar stands."""
    kept, at = b"", 0
    while at < len(recording):
        length = int.from_bytes(recording[at + 1 : at + 3], "big")
        kept += recording[at : at + length] if recording[at] == 48 else b""
        at += length
    return kept


def test_without_a_site_no_geojson_is_written(tmp_path):
    nowhere = tmp_path / "plots.ast"
    nowhere.write_bytes(plots_alone(DEMO.read_bytes()))
    found = only_object(boresight("track", nowhere, "-o", tmp_path, "--json"))
    assert any("--site" in remark for remark in found["remarks"])
    assert not any(path.endswith(".geojson") for path in found["outputs"])


def test_a_folder_that_cannot_be_made_is_told_before_any_work(tmp_path):
    (tmp_path / "file").touch()
    done = boresight("track", DEMO, "-o", tmp_path / "file")
    assert done.returncode == 74
    assert "-o DIR" in done.stderr


def test_a_recording_without_plots_says_what_it_holds(tmp_path):
    from boresight.formats.recording import read_recording

    read_recording(DEMO)  # it holds ADS-B, service messages and plots
    only_adsb = tmp_path / "adsb.ast"
    octets, at, kept = DEMO.read_bytes(), 0, b""
    while at < len(octets):
        length = int.from_bytes(octets[at + 1 : at + 3], "big")
        kept += octets[at : at + length] if octets[at] == 21 else b""
        at += length
    only_adsb.write_bytes(kept)
    done = boresight("track", only_adsb)
    assert done.returncode == 65
    assert "CAT021" in done.stderr


@pytest.mark.parametrize("arguments", [["inspect", DEMO], ["inspect", DEMO, "--json"], ["--help"]])
def test_a_reader_that_leaves_is_no_error(arguments):
    running = subprocess.Popen(
        [sys.executable, "-m", "boresight", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    running.stdout.close()
    said = running.stderr.read()
    running.stderr.close()
    assert running.wait(timeout=20) == 0
    assert said == ""


def opened(pipe):
    """A pipe's writing end, once somebody reads: the program has started, and is at work."""
    end = time.monotonic() + 30
    while True:
        try:
            return os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:
            assert time.monotonic() < end, "nobody reads"
            time.sleep(0.05)


def test_control_c_ends_with_130_and_no_traceback(tmp_path):
    pipe = tmp_path / "endless.ast"
    os.mkfifo(pipe)  # nothing ever comes, so the signal finds the program at work
    running = subprocess.Popen(
        [sys.executable, "-m", "boresight", "inspect", str(pipe)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    end = opened(pipe)
    time.sleep(0.5)  # from opening to reading
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=20)
    os.close(end)
    assert running.returncode == 130
    assert "Traceback" not in said


def test_a_fault_of_ours_is_one_sentence_and_code_70(monkeypatch, capsys):
    def broken(*_, **__):
        raise ZeroDivisionError("by design")

    monkeypatch.setattr("boresight.catalogue.cite", broken)
    assert cli.run(["cite", "ekf"]) == 70
    said = capsys.readouterr()
    assert said.err.splitlines() == [
        "error: boresight failed by a fault of its own: ZeroDivisionError: by design",
        "  next: run again with --debug and report what it prints",
    ]
    assert said.out == ""


@needs_barcelona
def test_the_barcelona_hour_is_inspected():
    found = only_object(boresight("inspect", BARCELONA, "--json"))
    (only,) = found["categories"]
    assert (only["category"], only["records"], only["sensor"]) == (48, 44_085, "20/129")
    assert found["addresses"] == 177
    assert only["scan_s"] == pytest.approx(4.0, abs=0.02)
    assert found["skipped_bytes"] == 0

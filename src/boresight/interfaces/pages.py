"""What `boresight`, `boresight --help` and `boresight --version` print, with nothing imported.

Building the command line costs ten times as long as printing this page. A test holds the page to
what the command line knows.
"""

import os
import sys
from collections.abc import Sequence

SUMMARY = "Calibrate radars, track targets, and say how far both can be trusted."
COMMANDS = {
    "inspect": "Say what a recording holds: format, sensors, times, damage.",
    "calibrate": "Find what is wrong with a radar, against GPS, ADS-B or downlink.",
    "track": "Turn a recording into tracks, tables and a report.",
    "tma": "From bearings and own ship's track to range, course and speed.",
    "compare": "Compare filters over the runs of a study, with bounds and verdicts.",
    "simulate": "Write the truth and the plots of a study, as tables.",
    "demo": "Calibrate and track the built-in recording, against known truth.",
    "reproduce": "Repeat a paper's tables and claims, with a verdict for each.",
    "cite": "Print a filter's reference, and where the code differs from it.",
}
OPTIONS = {
    "--json": "Print one JSON object on standard output, and nothing else there.",
    "--quiet": "Print no progress and no remarks.",
    "--debug": "Show the traceback of an error.",
    "--help": "Show this page; after a command, that command's own.",
    "--version": "Print the version.",
}
EXIT_CODES = (
    "0 done, 1 done but a stated check failed, 2 usage, 65 bad data, 66 no input,\n"
    "  69 an extra is missing, 70 a fault of ours, 74 cannot write, 130 interrupted"
)


def answer(arguments: Sequence[str]) -> str | None:
    """The static page for these arguments, or None where the command line must be built."""
    if not arguments or list(arguments) in (["--help"], ["-h"], ["help"]):
        return help_page()
    if list(arguments) == ["--version"]:
        return version() + "\n"
    return None


def version() -> str:
    """The installed version of boresight."""
    from importlib.metadata import version as installed

    return installed("boresight")


def help_page() -> str:
    """The page of `boresight --help`: 80 columns, no colour."""
    return (
        f"boresight {version()}\n{SUMMARY}\n\n"
        "Usage: boresight COMMAND [OPTIONS]\n\n"
        f"Commands\n{_listing(COMMANDS)}\n"
        f"Options of every command\n{_listing(OPTIONS)}\n"
        f"Exit codes\n  {EXIT_CODES}\n\n"
        "Start with: boresight demo\n"
    )


def _listing(entries: dict[str, str]) -> str:
    width = max(map(len, entries)) + 2
    return "".join(f"  {name:<{width}}{line}\n" for name, line in entries.items())


def close_broken_pipe() -> None:
    """Point standard output nowhere: its reader has left, and Python must not flush to it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

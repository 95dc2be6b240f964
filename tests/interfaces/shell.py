"""The command as a user types it, in a process of its own, warnings being errors."""

import subprocess
import sys


def boresight(*arguments):
    """What the command gave: `returncode`, `stdout` and `stderr`."""
    return subprocess.run(
        [sys.executable, "-W", "error", "-m", "boresight", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )

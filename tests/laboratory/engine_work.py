"""Work that engines are tested with; it stands in a module, so that any process can import it."""

import os
import signal
import time
from pathlib import Path


def square(x):
    return x * x


def chatty(x):
    print("what a filter prints must not harm")  # noqa: T201 - a user's filter does
    return x


def whose(x):
    time.sleep(0.02)
    return x, os.getpid()


def group(_x):
    return os.getpgrp()


def fragile(x):
    if x == 3:
        raise ValueError("three is wrong")
    return x


def dies(x):
    if x == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


def dies_once(marker, x):
    """Kills its process the first time that anything is asked of it."""
    if not Path(marker).exists():
        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return x


class OddError(Exception):
    """An error that is pickled but cannot be read again."""

    def __init__(self, one, other):
        super().__init__(f"{one} {other}")


def odd(x):
    raise OddError("strange", x)


def leaves_name(folder, x):
    """Leave the process's number in a folder."""
    (Path(folder) / str(os.getpid())).touch()
    time.sleep(0.05)
    return x


def ever_longer(folder, x):
    """The same; after the first tasks each takes a minute."""
    leaves_name(folder, x)
    if x >= 2:
        time.sleep(60.0)
    return x

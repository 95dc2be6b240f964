"""The `boresight` command: a static page at once, everything else by the command line proper."""

import sys

from boresight.interfaces import pages


def main() -> int:
    """Run the command line on `sys.argv` and return the exit code (DESIGN, 'The command line')."""
    try:
        page = pages.answer(sys.argv[1:])
        if page is None:
            from boresight.interfaces.cli import run  # heavy: only when there is something to do

            return run(sys.argv[1:])
        sys.stdout.write(page)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        pages.close_broken_pipe()
    return 0


if __name__ == "__main__":
    sys.exit(main())

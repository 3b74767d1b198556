"""The command `echolocate`, also as `python -m runtime.cli`: signals are handled before anything else is imported."""

from __future__ import annotations

import os
import sys

from runtime.cli.first_signals import handle_first_signals

GARBAGE_MAX = 10_000
"""Objects from one garbage collection to the next: Python's 700 make a thousand collections of a start, which find
nothing."""
ARRAY_THREADS = "OPENBLAS_NUM_THREADS"
"""How many threads numpy multiplies matrices with; it reads this when it is imported. Ours are small: threads spend
more processor time on waiting for one another than they save, and round as the number of processors has it."""


def main() -> None:
    """Run the command line and exit."""
    handle_first_signals()
    os.environ.setdefault(ARRAY_THREADS, "1")
    import gc

    gc.set_threshold(GARBAGE_MAX)
    from runtime.cli.standard_streams import open_standard_streams

    open_standard_streams()
    if not _has_working_directory():
        from config.errors import WRONG_CALL

        sys.stderr.write("echolocate: the working directory has been removed; change into another one\n")
        sys.exit(WRONG_CALL)
    from runtime.cli.app import main as run_app

    run_app()


def _has_working_directory() -> bool:
    try:
        return bool(os.getcwd())  # noqa: PTH109 - pathlib is imported later
    except OSError:
        return False


if __name__ == "__main__":
    main()

"""Whether a program has its terminal. The process that draws imports this, and it imports nothing that takes long."""

from __future__ import annotations

import os


def in_foreground(fd: int) -> bool:
    """Return whether the program has the terminal: one in the background is stopped if it reads or changes it.

    Parameters
    ----------
    fd : int
        Of the terminal; one that is gone belongs to no program, and may be read.
    """
    try:
        return os.tcgetpgrp(fd) == os.getpgrp()
    except OSError:
        return True

"""Single keys of the terminal: arm, halt and quit, and what others make of the rest."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from types import MappingProxyType
from typing import Final

from runtime.cycle.inputs import Request

KEYS_MAX: Final = 64
KEYS: Final = MappingProxyType({" ": Request.HALT, "h": Request.HALT, "a": Request.ARM})


@contextlib.contextmanager
def keys(
    on_request: Callable[[Request], None],
    on_quit: Callable[[], None],
    on_other: Callable[[str], None] = lambda _key: None,
    on_return: Callable[[], None] = lambda: None,
) -> Iterator[None]:
    """Read single keys from the terminal during the block, if there is one.

    Parameters
    ----------
    on_request : callable
        Called for the keys of `KEYS`.
    on_quit : callable
        Called for q, and when the terminal is gone.
    on_other : callable
        Called with any other key.
    on_return : callable
        Called when the program is continued in the foreground, where the shell has written meanwhile.
    """
    if not sys.stdin.isatty():
        yield
        return
    fd = sys.stdin.fileno()
    before = termios.tcgetattr(fd)
    loop = asyncio.get_running_loop()

    def read() -> None:
        # Not through sys.stdin: what is in its buffer does not wake the loop.
        try:
            pressed = os.read(fd, KEYS_MAX)
        except OSError:
            pressed = b""
        if not pressed:
            # The terminal is gone, and with it the keys that halt the robot.
            loop.remove_reader(fd)
            on_quit()
        for key in pressed.decode(errors="replace"):
            if key in KEYS:
                on_request(KEYS[key])
            elif key == "q":
                on_quit()
            else:
                on_other(key)

    def take_keys() -> None:
        # A process in the background may not change the terminal; fg continues it once more.
        if os.tcgetpgrp(fd) == os.getpgrp():
            tty.setcbreak(fd, termios.TCSANOW)  # which keeps a key that was pressed meanwhile
            on_return()

    tty.setcbreak(fd)
    loop.add_reader(fd, read)
    loop.add_signal_handler(signal.SIGCONT, take_keys)  # the shell sets its own mode meanwhile
    try:
        yield
    finally:
        loop.remove_signal_handler(signal.SIGCONT)
        loop.remove_reader(fd)
        with contextlib.suppress(termios.error):
            termios.tcsetattr(fd, termios.TCSADRAIN, before)

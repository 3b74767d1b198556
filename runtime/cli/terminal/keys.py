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

from runtime.cli.terminal.foreground import in_foreground
from runtime.cycle.inputs import Request

KEYS_MAX: Final = 64
KEYS: Final = MappingProxyType({" ": Request.HALT, "h": Request.HALT, "a": Request.ARM})
BACKGROUND_S: Final = 0.25
"""How often a program in the background looks whether it is in the foreground again, s: a shell's fg sends no
signal to one that runs."""


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
    look: asyncio.TimerHandle | None = None

    def read() -> None:
        # Not through sys.stdin: what is in its buffer does not wake the loop.
        if not in_foreground(fd):  # what is typed is for the shell
            wait_for_foreground()
            return
        try:
            pressed = os.read(fd, KEYS_MAX)
        except OSError:
            pressed = b""
        if not pressed:
            # The terminal is gone, and with it the keys that halt the robot.
            loop.remove_reader(fd)
            on_quit()
        is_sequence = pressed.startswith(b"\x1b")  # a key of several letters, which mean nothing by themselves
        for key in pressed.decode(errors="replace"):
            if is_sequence and KEYS.get(key) is not Request.HALT:
                continue
            if key in KEYS:
                on_request(KEYS[key])
            elif key == "q":
                on_quit()
            else:
                on_other(key)

    def take_keys(when: int) -> bool:
        if not in_foreground(fd):
            return False
        with contextlib.suppress(termios.error):
            tty.setcbreak(fd, when)
        loop.add_reader(fd, read)
        return True

    def wait_for_foreground() -> None:
        nonlocal look
        loop.remove_reader(fd)
        if look is not None:
            look.cancel()
        if take_keys(termios.TCSANOW):  # which keeps a key that was pressed meanwhile
            on_return()
        else:
            look = loop.call_later(BACKGROUND_S, wait_for_foreground)

    # What was typed before anything could be seen is dropped: it was for the shell.
    if not take_keys(termios.TCSAFLUSH):  # started in the background
        wait_for_foreground()
    loop.add_signal_handler(signal.SIGCONT, wait_for_foreground)  # the shell sets its own mode meanwhile
    try:
        yield
    finally:
        loop.remove_signal_handler(signal.SIGCONT)
        loop.remove_reader(fd)
        if look is not None:
            look.cancel()
        if in_foreground(fd):
            with contextlib.suppress(termios.error):
                termios.tcsetattr(fd, termios.TCSADRAIN, before)

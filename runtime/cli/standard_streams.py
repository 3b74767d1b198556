"""Standard input, output and error on which no write can end the program with a traceback.

Any of the three may be closed, full, or for another character set. What cannot be encoded is escaped. If standard
output cannot be written, the command fails with one line; if standard error cannot, its lines are lost.
"""

from __future__ import annotations

import contextlib
import io
import os
import select
import sys
from collections.abc import Iterator
from typing import Final, TextIO

from config.errors import FAILED, UserError

STANDARD: Final = (0, 1, 2)
"""Descriptors of standard input, output and error."""
FULL_PIPE_WAIT_S: Final = 1.0
"""How long a line on standard error waits for a reader that does not read."""
ESCAPED: Final = "backslashreplace"
"""How characters are written that the stream's character set does not have."""


class ReaderGoneError(Exception):
    """The reader of standard output has what it wants, as `head` does.

    It is no BrokenPipeError, at which rich ends the program as failed.
    """


class StandardOutput(io.TextIOWrapper):
    """Standard output, which reports why it cannot be written."""

    def write(self, text: str, /) -> int:
        """Write a text.

        Raises
        ------
        ReaderGoneError
            The reader has gone.
        UserError
            Standard output cannot be written for another reason.
        """
        with self._reported():
            return super().write(text)

    def flush(self) -> None:
        """Write what waits; raise as `write`."""
        with self._reported():
            super().flush()

    @contextlib.contextmanager
    def _reported(self) -> Iterator[None]:
        """Turn an error of writing into an end in order: quietly if the reader has gone, else with the cause."""
        try:
            yield
        except OSError as error:
            redirect_to_null(self.fileno())  # Python flushes once more at exit
            if isinstance(error, BrokenPipeError):
                raise ReaderGoneError from None
            raise UserError(
                f"standard output cannot be written: {error.strerror}; make room or redirect it elsewhere", FAILED
            ) from None


class StandardError(io.TextIOWrapper):
    """Standard error, which loses what cannot be written: there is no other place to report that.

    A pipe that is full and has a reader which does not read would hold the program, and its end, for ever.
    """

    _wait_s = FULL_PIPE_WAIT_S

    def write(self, text: str, /) -> int:
        """Write a text, or lose it."""
        with contextlib.suppress(OSError):
            if select.select([], [self.fileno()], [], self._wait_s)[1]:
                super().write(text)
                self._wait_s = FULL_PIPE_WAIT_S
            else:
                self._wait_s = 0.0
        return len(text)

    def flush(self) -> None:
        """Write what waits, or lose it."""
        with contextlib.suppress(OSError):
            super().flush()


def open_standard_streams() -> None:
    """Open what is closed, and replace Python's own streams; call this before any file is opened."""
    for fd in STANDARD:
        if not is_open(fd):
            redirect_to_null(fd)
    if sys.stdin is None:
        sys.stdin = io.TextIOWrapper(io.FileIO(0, closefd=False), encoding="utf-8")
    sys.stdout = _replaced(sys.stdout, 1, StandardOutput)
    sys.stderr = _replaced(sys.stderr, 2, StandardError)


def is_open(fd: int) -> bool:
    """Return whether a descriptor is open."""
    try:
        os.fstat(fd)
    except OSError:
        return False
    return True


def redirect_to_null(fd: int) -> None:
    """Let a descriptor, open or closed, refer to the null device."""
    null = os.open(os.devnull, os.O_RDWR)
    if null == fd:
        os.set_inheritable(fd, True)  # noqa: FBT003 - it takes no keyword
    else:
        os.dup2(null, fd)
        os.close(null)


def _replaced(
    stream: TextIO | None, fd: int, kind: type[StandardOutput | StandardError]
) -> StandardOutput | StandardError:
    """Return a stream of another class in place of one of Python's own, which is None if it was closed."""
    if not isinstance(stream, io.TextIOWrapper):
        return kind(io.FileIO(fd, "w", closefd=False), encoding="utf-8", errors=ESCAPED)
    line_buffering, write_through, encoding = stream.line_buffering, stream.write_through, stream.encoding
    return kind(
        stream.detach(), encoding=encoding, errors=ESCAPED, line_buffering=line_buffering, write_through=write_through
    )

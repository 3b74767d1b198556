"""The log: JSON lines in a file for programs, coloured lines on the terminal for people.

Lines are written in the background: a stalled or full disk, a terminal held by Ctrl-S or a pipe without a reader
delays no cycle. Lost lines are counted and reported wherever lines still arrive. The rate of lines and the size of
the file are bounded, whatever causes them.
"""

from __future__ import annotations

import contextlib
import logging
import os
import sys
import time
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import orjson
import structlog

from config.errors import WRONG_CALL, UserError
from config.files import one_line, utf8
from drivers.token_bucket import LineLimit
from runtime.support.background_writer import BackgroundWriter
from runtime.support.log_file import LogFile
from runtime.support.log_sentence import sentence
from runtime.support.user_folders import expanded, has_home, state_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, MutableMapping
    from typing import TextIO

    from structlog.typing import FilteringBoundLogger

    from config.settings import LogConfig

    LogListener = Callable[[Mapping[str, Any]], None]


LOG_FILE: Final = "echolocate.jsonl"
"""Default file, in the user's state folder."""
ALWAYS: Final = frozenset({"console"})
"""Events that are written at every level: without its start URL the console is of no use."""
SECRET: Final = frozenset({"start_url"})
"""Fields written only to the log file and a terminal: recordings are passed on, and many may read a journal."""
LINES_PER_S: Final = 5.0
LINES_BURST: Final = 300.0
"""Lines of one level at once; each level has its own limit, so that warnings suppress no error."""
MEGABYTE: Final = 1_000_000
NOT_SAID: Final = frozenset({"event", "level", "timestamp", "exception"})
SECONDS: Final = len("2026-01-02T03:04:05")
"""A time on the terminal, in UTC, has no fractions of seconds; those are in the file."""
COLOURS: Final = MappingProxyType(
    {"debug": "\x1b[2m", "info": "\x1b[32m", "warning": "\x1b[33m", "error": "\x1b[1;31m"}
)
COLOUR_END: Final = "\x1b[0m"


class LogStatus:
    """The writers of a run's log and what they lost; still valid after the end of the run."""

    def __init__(self) -> None:
        self.file: BackgroundWriter[bytes] | None = None
        self.terminal: BackgroundWriter[bytes] | None = None
        self.listeners: list[LogListener] = []
        """Each is called with every line, without its secret fields."""

    @property
    def lost(self) -> int:
        """Number of lines that are missing in the file."""
        return 0 if self.file is None else self.file.lost

    @property
    def last_error(self) -> str | None:
        """Why lines are missing in the file, the last time; None if none are."""
        return None if self.file is None else self.file.last_error

    def probe(self) -> str | None:
        """Return how one of the writers' threads ended; None while they run. See `runtime.support.health`."""
        writers = (writer for writer in (self.file, self.terminal) if writer is not None)
        return next((how for writer in writers if (how := writer.probe()) is not None), None)


def takes_colours() -> bool:
    """Return whether the user's terminal takes colours, by its type and https://no-color.org."""
    return not os.environ.get("NO_COLOR") and os.environ.get("TERM") not in {"dumb", "unknown"}


class _LevelFilter:
    """The first processor of structlog: drop lines below the configured level, but for those of `ALWAYS`."""

    def __init__(self, level: str) -> None:
        self._level = logging.getLevelNamesMapping()[level.upper()]
        self._levels = {name.lower(): number for name, number in logging.getLevelNamesMapping().items()}

    def __call__(self, _logger: object, name: str, event: MutableMapping[str, Any]) -> Mapping[str, Any]:
        if self._levels.get(name, logging.ERROR) < self._level and event["event"] not in ALWAYS:
            raise structlog.DropEvent
        return event


class _LineOutput:
    """The last processor of structlog: send one line to the file, the terminal and the listeners."""

    def __init__(
        self,
        status: LogStatus,
        terminal: TextIO | None,
        listener: LogListener | None,
        path: Path,
        clock: Callable[[], float],
    ) -> None:
        self._status = status
        self._listener = listener
        self._reported: str | None = None
        self._limits: dict[str, LineLimit] = {}
        self._clock = clock
        self._is_terminal = terminal is not None and terminal.isatty()
        self._path = path
        self._has_colours = self._is_terminal and takes_colours()

    def __call__(self, _logger: object, name: str, event: MutableMapping[str, Any]) -> Mapping[str, Any]:
        limit = self._limits.setdefault(name, LineLimit(LINES_PER_S, LINES_BURST))
        left_out = limit.take(self._clock())
        if left_out is None:
            raise structlog.DropEvent
        if left_out:
            event["left_out_before"] = left_out
        settings = event.pop("settings", None)
        event = {name: utf8(value) if isinstance(value, str) else value for name, value in event.items()}
        self._report_error(event)
        if self._status.file is not None:
            if settings is not None:
                self._status.file.put(_json({"event": "settings", "settings": settings}))
            self._status.file.put(_json(event))
        self._show(event)
        raise structlog.DropEvent

    @property
    def left_out(self) -> int:
        """Number of lines left out since the last one of their level."""
        return sum(limit.suppressed for limit in self._limits.values())

    def _report_error(self, event: Mapping[str, Any]) -> None:
        """Warn once of each error of the file, on the terminal and to the listeners."""
        error = self._status.last_error
        if error != self._reported:
            self._reported = error
            warning = {"event": "log lines are missing in the file", "reason": error, "lost": self._status.lost}
            self._show({**warning, "level": "warning", "timestamp": event.get("timestamp")})

    def _show(self, event: Mapping[str, Any]) -> None:
        """Pass a line to the listeners, without its secret fields, and to the terminal, if there is one."""
        for listener in (*(() if self._listener is None else (self._listener,)), *self._status.listeners):
            listener({name: value for name, value in event.items() if name not in SECRET})
        if self._status.terminal is not None:
            where = "on a terminal only" if self._status.file is None else f"in {self._path}"
            hidden = {} if self._is_terminal else dict.fromkeys(SECRET & event.keys(), where)
            shown = _line_for_people({**event, **hidden}, has_colours=self._has_colours)
            self._status.terminal.put(shown.encode(errors="replace"))


def _line_for_people(event: Mapping[str, Any], *, has_colours: bool) -> str:
    """Return a line as it may go to a terminal, which obeys control characters wherever they come from."""
    shown = {name: one_line(value) if isinstance(value, str) else value for name, value in event.items()}
    rest = {name: value for name, value in shown.items() if name not in NOT_SAID}
    level = f"{event['level']:7}"
    if has_colours:
        level = f"{COLOURS.get(event['level'], '')}{level}{COLOUR_END}"
    line = f"{str(event['timestamp'])[:SECONDS]}Z [{level}] {one_line(sentence(shown['event'], rest))}\n"
    return line + "".join(f"{one_line(part)}\n" for part in str(event.get("exception", "")).splitlines())


def _json(event: Mapping[str, Any]) -> bytes:
    return orjson.dumps(dict(event), default=str, option=orjson.OPT_APPEND_NEWLINE)


@contextlib.contextmanager
def open_log(
    config: LogConfig,
    *,
    terminal: bool,
    listener: LogListener | None = None,
    status: LogStatus | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[FilteringBoundLogger]:
    """Yield the logger of the run; at the end, write what is left and close the file.

    Parameters
    ----------
    config : LogConfig
        File and level.
    terminal : bool
        Whether lines also go to stderr; False while the live view uses the screen.
    listener : callable, optional
        Called with every line: the recording.
    status : LogStatus, optional
        Receives the writers, for who reports on them.
    clock : callable
        Limits the rate of lines, s.

    Raises
    ------
    UserError
        The configured file cannot be opened.
    """
    status = LogStatus() if status is None else status
    path = log_path(config)
    file, error = _open_file(config, path)
    output = _LineOutput(status, sys.stderr if terminal else None, listener, path, clock)
    with contextlib.ExitStack() as stack:
        if terminal:
            status.terminal = stack.enter_context(terminal_writer("log on the terminal", sys.stderr))
        if file is not None:
            status.file = stack.enter_context(file_writer("log", file))
        log: FilteringBoundLogger = structlog.wrap_logger(
            None,
            processors=[
                _LevelFilter(config.level),
                structlog.processors.add_log_level,
                structlog.processors.TimeStamper(fmt="iso", utc=True),
                structlog.processors.format_exc_info,
                output,
            ],
            wrapper_class=structlog.make_filtering_bound_logger(logging.NOTSET),
        )
        if error is not None:
            log.warning("no log file is written", reason=error)
        elif config.file is None and not has_home():
            log.warning(
                "no home folder is known, so log and recordings go to a temporary one; set HOME or XDG_STATE_HOME",
                folder=str(state_folder()),
            )
        yield log
        if output.left_out and status.file is not None:
            status.file.put(_json({"event": "log lines were left out at the end", "left_out": output.left_out}))


def file_writer(name: str, file: LogFile) -> BackgroundWriter[bytes]:
    """Return a writer into a log file, which it closes at the end; a line with their number replaces lost lines."""

    def write_gap(count: int) -> None:
        file.write(_json({"event": "log lines are missing here", "level": "warning", "lost": count}))

    return BackgroundWriter(name, file.write, write_gap=write_gap, finish=file.close)


def terminal_writer(name: str, stream: TextIO) -> BackgroundWriter[bytes]:
    """Return a writer of lines to a stream, which stays open.

    It bypasses the stream's buffer: a thread blocked while it holds the lock of that buffer would block the exit.
    """
    try:
        fd = stream.fileno()
    except OSError:

        def write(line: bytes) -> None:
            stream.write(line.decode())
            stream.flush()

        return BackgroundWriter(name, write)

    def write_all(line: bytes) -> None:
        rest = memoryview(line)
        while rest:
            rest = rest[os.write(fd, rest) :]

    return BackgroundWriter(name, write_all)


def log_path(config: LogConfig) -> Path:
    """Return the path of the log file: the configured one, or else `echolocate.jsonl` in the user's state folder."""
    return state_folder() / LOG_FILE if config.file is None else expanded(config.file, "log.file")


def _open_file(config: LogConfig, path: Path) -> tuple[LogFile | None, str | None]:
    """Return the log file, or None and the reason why the default file cannot be written."""
    try:
        return LogFile(path, round(config.cap_mb * MEGABYTE)), None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        if config.file is None:
            return None, f"{path}: {reason}"
        raise UserError(
            f"log.file = {config.file!r} cannot be written: {reason}; choose another file", WRONG_CALL
        ) from error

"""The log: JSON lines to a file for machines, coloured lines on the terminal for people.

A line is handed over and the loop goes on: a disk that stands still, a full one, a terminal held by Ctrl-S or a pipe
that nobody reads delay no cycle. What is lost is counted, and told wherever a line still arrives.
"""

from __future__ import annotations

import contextlib
import logging
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import orjson
import structlog

from config.errors import WRONG_CALL, UserError
from runtime.support.background_writer import BackgroundWriter, to_file, to_terminal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, MutableMapping
    from typing import TextIO

    from structlog.typing import FilteringBoundLogger

    from config.settings import LogConfig

    Tap = Callable[[Mapping[str, Any]], None]


SECRET: Final = frozenset({"start_url"})
"""What only the log's own file and the terminal hold: recordings are handed on, and lines are shown to strangers."""


class LogStanding:
    """How the log of a run stands, also after its end."""

    def __init__(self) -> None:
        self.file: BackgroundWriter | None = None
        self.terminal: BackgroundWriter | None = None
        self.listeners: list[Tap] = []
        """Get every line, too, but for what is secret in it."""

    @property
    def lost(self) -> int:
        """Lines that did not get into the file."""
        return 0 if self.file is None else self.file.lost

    @property
    def trouble(self) -> str | None:
        """The last one with the file."""
        return None if self.file is None else self.file.trouble

    def probe(self) -> str | None:
        """Say which of its threads has ended; None while they run. See `runtime.support.health`."""
        sinks = (sink for sink in (self.file, self.terminal) if sink is not None)
        return next((how for sink in sinks if (how := sink.probe()) is not None), None)


class _Tee:
    """The last processor: one line to the file, one to the terminal where it is wanted."""

    def __init__(self, standing: LogStanding, terminal: TextIO | None, tap: Tap | None) -> None:
        self._standing = standing
        self._tap = tap
        self._told: str | None = None
        colors = terminal is not None and terminal.isatty()
        self._render = structlog.dev.ConsoleRenderer(colors=colors, pad_event_to=0)

    def __call__(self, logger: object, name: str, event: MutableMapping[str, Any]) -> Mapping[str, Any]:
        settings = event.pop("settings", None)
        self._note_trouble(logger, event)
        if self._standing.file is not None:
            if settings is not None:
                self._standing.file.put(_json({"event": "settings", "settings": settings}))
            self._standing.file.put(_json(event))
        self._show(logger, name, event)
        raise structlog.DropEvent

    def _note_trouble(self, logger: object, event: Mapping[str, Any]) -> None:
        """Tell of trouble with the file before the line that finds it, where lines still arrive."""
        trouble = self._standing.trouble
        if trouble != self._told:
            self._told = trouble
            warning = {"event": "the log has trouble", "reason": trouble, "lost": self._standing.lost}
            self._show(logger, "warning", {**warning, "level": "warning", "timestamp": event.get("timestamp")})

    def _show(self, logger: object, name: str, event: Mapping[str, Any]) -> None:
        for listen in (*(() if self._tap is None else (self._tap,)), *self._standing.listeners):
            listen({name: value for name, value in event.items() if name not in SECRET})
        if self._standing.terminal is not None:
            self._standing.terminal.put((str(self._render(logger, name, dict(event))) + "\n").encode())


def _json(event: Mapping[str, Any]) -> bytes:
    return orjson.dumps(dict(event), default=str, option=orjson.OPT_APPEND_NEWLINE)


@contextlib.contextmanager
def open_log(
    config: LogConfig, *, terminal: bool, tap: Tap | None = None, standing: LogStanding | None = None
) -> Iterator[FilteringBoundLogger]:
    """Give the run's logger; its file is closed at the end.

    Parameters
    ----------
    config : LogConfig
        File and level.
    terminal : bool
        Whether lines also go to stderr; not while a live view owns the screen.
    tap : callable, optional
        Gets every line, too: a recording.
    standing : LogStanding, optional
        Is kept up to date with how the log stands.

    Raises
    ------
    UserError
        The file cannot be opened.
    """
    standing = LogStanding() if standing is None else standing
    fd, lost = _open_file(config)
    with contextlib.ExitStack() as stack:
        if terminal:
            standing.terminal = stack.enter_context(to_terminal("log on the terminal", sys.stderr))
        if fd is not None:
            standing.file = stack.enter_context(to_file("log", fd, _missing))
        log: FilteringBoundLogger = structlog.wrap_logger(
            None,
            processors=[
                structlog.processors.add_log_level,
                structlog.processors.TimeStamper(fmt="iso", utc=True),
                structlog.processors.format_exc_info,
                _Tee(standing, sys.stderr if terminal else None, tap),
            ],
            wrapper_class=structlog.make_filtering_bound_logger(getattr(logging, config.level.upper())),
        )
        if lost is not None:
            log.warning("no log file is kept", reason=lost)
        yield log


def _missing(count: int) -> bytes:
    """Return the line that stands where lines are missing."""
    return _json({"event": "lines of the log are missing here", "level": "warning", "lost": count})


def _open_file(config: LogConfig) -> tuple[int | None, str | None]:
    """Return the file, or why there is none: only one that was asked for is worth not starting at all."""
    state = os.environ.get("XDG_STATE_HOME") or "~/.local/state"
    path = Path(config.file or f"{state}/echolocate/echolocate.jsonl").expanduser()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOCTTY, 0o600), None
    except OSError as error:
        if config.file is None:
            return None, f"{path}: {error.strerror}"
        raise UserError(
            f"log.file = {config.file!r} cannot be written: {error.strerror}; choose another file", WRONG_CALL
        ) from error

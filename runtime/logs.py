"""The log: JSON lines to a file for machines, coloured lines on the terminal for people."""

from __future__ import annotations

import contextlib
import logging
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import orjson
import structlog

from runtime.complaint import WRONG_CALL, Complaint

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, MutableMapping

    from structlog.typing import FilteringBoundLogger

    from config.settings import LogConfig

    Tap = Callable[[Mapping[str, Any]], None]


class _Tee:
    """The last processor: one line to the file, one to the terminal where it is wanted."""

    def __init__(self, file: TextIO | None, terminal: TextIO | None, tap: Tap | None) -> None:
        self._file = file
        self._terminal = terminal
        self._tap = tap
        colors = terminal is not None and terminal.isatty()
        self._render = structlog.dev.ConsoleRenderer(colors=colors, pad_event_to=0)

    def __call__(self, logger: Any, name: str, event: MutableMapping[str, Any]) -> Mapping[str, Any]:  # noqa: ANN401
        settings = event.pop("settings", None)
        if self._file is not None and settings is not None:
            self._file.write(orjson.dumps({"event": "settings", "settings": settings}, default=str).decode() + "\n")
        if self._file is not None:
            self._file.write(orjson.dumps(dict(event), default=str).decode() + "\n")
            self._file.flush()
        if self._tap is not None:
            self._tap(dict(event))
        if self._terminal is not None:
            self._terminal.write(str(self._render(logger, name, dict(event))) + "\n")
        raise structlog.DropEvent


@contextlib.contextmanager
def open_log(config: LogConfig, *, terminal: bool, tap: Tap | None = None) -> Iterator[FilteringBoundLogger]:
    """Give the run's logger; its file is closed at the end.

    Parameters
    ----------
    config : LogConfig
        File and level.
    terminal : bool
        Whether lines also go to stderr; not while a live view owns the screen.
    tap : callable, optional
        Gets every line, too: a recording.

    Raises
    ------
    Complaint
        The file cannot be opened.
    """
    file, lost = _open_file(config)
    log: FilteringBoundLogger = structlog.wrap_logger(
        None,
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            _Tee(file, sys.stderr if terminal else None, tap),
        ],
        wrapper_class=structlog.make_filtering_bound_logger(getattr(logging, config.level.upper())),
    )
    if lost is not None:
        log.warning("no log file is kept", reason=lost)
    try:
        yield log
    finally:
        if file is not None:
            file.close()


def _open_file(config: LogConfig) -> tuple[TextIO | None, str | None]:
    """Return the file, or why there is none: only one that was asked for is worth not starting at all."""
    state = os.environ.get("XDG_STATE_HOME") or "~/.local/state"
    path = Path(config.file or f"{state}/echolocate/echolocate.jsonl").expanduser()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("a", encoding="utf-8"), None
    except OSError as error:
        if config.file is None:
            return None, f"{path}: {error.strerror}"
        raise Complaint(
            f"log.file = {config.file!r} cannot be written: {error.strerror}; choose another file", WRONG_CALL
        ) from error

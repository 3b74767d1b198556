"""Forwarding of the HTTP library's log to the console's, without tracebacks and at a bounded rate."""

from __future__ import annotations

import logging
from typing import Final

from runtime.console.http.client_limits import ConsoleLog

MESSAGE_MAX: Final = 200
"""Characters of a line."""


class LogForwarder(logging.Handler):
    """Logs what aiohttp reports, which is mostly a peer that does not speak HTTP, as something refused."""

    def __init__(self, log: ConsoleLog) -> None:
        super().__init__()
        self._log = log

    def emit(self, record: logging.LogRecord) -> None:
        """Forward a report as one line."""
        error = record.exc_info[1] if record.exc_info else None
        text = f"{record.getMessage()}{f': {type(error).__name__}' if error else ''}"
        self._log.refuse(ascii(text)[1:-1][:MESSAGE_MAX], "a connection")

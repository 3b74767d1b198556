"""Reports of the HTTP library end as one line each, without a traceback."""

from __future__ import annotations

import logging
from typing import Any

import structlog

from runtime.console.http.client_limits import ConsoleLog
from runtime.console.http.log_forwarder import MESSAGE_MAX, LogForwarder


def test_a_report_with_an_error_is_one_bounded_line() -> None:
    lines: list[dict[str, Any]] = []

    def keep(_logger: object, _name: str, event: Any) -> Any:
        lines.append(dict(event))
        raise structlog.DropEvent

    logger = logging.Logger("console")
    logger.addHandler(LogForwarder(ConsoleLog(structlog.wrap_logger(None, processors=[keep]), lambda: 0.0)))
    logger.error("bad request \x1b[31m", exc_info=ValueError("secret"))
    logger.error("x" * 1000)
    assert lines[0]["reason"] == "bad request \\x1b[31m: ValueError"
    assert len(lines[1]["reason"]) == MESSAGE_MAX

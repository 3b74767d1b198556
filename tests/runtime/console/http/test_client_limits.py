"""Bounds on lines in the log."""

from __future__ import annotations

from typing import Any

import structlog

from runtime.console.http.client_limits import LOG_LINES_BURST, ConsoleLog


def test_lines_beyond_the_rate_are_counted_not_logged() -> None:
    lines: list[dict[str, Any]] = []

    def keep(_logger: object, _name: str, event: Any) -> Any:
        lines.append(dict(event))
        raise structlog.DropEvent

    host_s = [0.0]
    log = ConsoleLog(structlog.wrap_logger(None, processors=[keep]), lambda: host_s[0])
    for _ in range(100):
        log.refuse("a wrong token, or none", "10.0.0.7")
    assert (len(lines), log.refusals) == (LOG_LINES_BURST, 100)
    host_s[0] = 1.0
    log.refuse("a wrong token, or none", "10.0.0.7")
    assert lines[-1]["suppressed_before"] == 100 - LOG_LINES_BURST
    log.note("console page opened", client="client 1")
    assert lines[-1]["event"] == "console page opened", "notes have a rate of their own"

"""Warnings reach a web address: together, at a bounded rate, and without a wait for an address that is dead."""

from __future__ import annotations

import threading
from http.client import BadStatusLine
from typing import Any

import orjson
import pytest
from pydantic import ValidationError

from config.settings import LogConfig
from runtime.support.webhook import LINES_MAX, Webhook


def line(level: str, event: str, **fields: Any) -> dict[str, Any]:
    return {"level": level, "event": event, **fields}


def test_warnings_are_sent_together_and_other_lines_are_not() -> None:
    sent = list[tuple[str, dict[str, Any]]]()
    hook = Webhook("http://x", 60.0, "Ella", lambda url, body: sent.append((url, orjson.loads(body))))
    hook.on_log(line("info", "mode", mode="DRIVE"))
    hook.send_now()
    assert sent == []
    hook.on_log(line("warning", "sensor 4 is silent", since_s=30))
    hook.on_log(line("error", "the line is lost"))
    hook.send_now()
    ((url, body),) = sent
    assert url == "http://x"
    assert body["text"] == "Ella\nwarning: Sensor 4 is silent (since 30 s)\nerror: The line is lost."
    assert [one["event"] for one in body["lines"]] == ["sensor 4 is silent", "the line is lost"]


def test_a_message_that_is_not_taken_goes_with_the_next_one_and_its_size_is_bounded() -> None:
    bodies, dead = list[dict[str, Any]](), [True]

    def send(_url: str, body: bytes) -> None:
        if dead[0]:
            raise OSError("no route")
        bodies.append(orjson.loads(body))

    hook = Webhook("http://x", 60.0, "Ella", send)
    for k in range(LINES_MAX + 10):
        hook.on_log(line("warning", f"{k}"))
    hook.send_now()
    dead[0] = False
    hook.send_now()
    hook.send_now()
    assert [one["event"] for one in bodies[0]["lines"]] == [str(k) for k in range(10, LINES_MAX + 10)]
    assert len(bodies) == 1


@pytest.mark.parametrize("error", [OSError("no route"), BadStatusLine("SSH-2.0"), ValueError("Invalid IPv6 URL")])
def test_no_line_is_lost_that_comes_while_a_message_is_refused(error: Exception) -> None:
    sent = list[list[str]]()

    def send(_url: str, body: bytes) -> None:
        sent.append([one["event"] for one in orjson.loads(body)["lines"]])
        if len(sent) == 1:
            hook.on_log(line("warning", "second"))
            raise error

    hook = Webhook("http://x", 60.0, "Ella", send)
    hook.on_log(line("warning", "first"))
    hook.send_now()
    hook.send_now()
    assert sent == [["first"], ["first", "second"]]


def test_the_log_never_waits_for_a_dead_address() -> None:
    stuck, reached = threading.Event(), threading.Event()

    def send(_url: str, _body: bytes) -> None:
        reached.set()
        stuck.wait()

    hook = Webhook("http://x", 0.0, "Ella", send)
    with hook.sending():
        hook.on_log(line("warning", "first"))
        assert reached.wait(60.0)
        hook.on_log(line("warning", "second"))  # while the first is on its way
    stuck.set()


@pytest.mark.parametrize("url", ["file:///etc/passwd", "ftp://x", "x"])
def test_only_web_addresses_are_taken(url: str) -> None:
    with pytest.raises(ValidationError):
        LogConfig(webhook=url)

"""Warnings to a web address: what the log says at level warning and above reaches a person who looks at no page.

The log only appends to a bounded list; a thread of its own sends what has come together, one message in each period,
as JSON with a `text`, which chat programs show, and the single `lines`. An address that does not answer is tried
again with the next message; nothing waits for it.
"""

from __future__ import annotations

import contextlib
import http.client
import threading
import urllib.request
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

import orjson

from runtime.support.log_sentence import sentence

LEVELS: Final = ("warning", "error", "critical")
LINES_MAX: Final = 50
"""Lines of a message; of more, the newest."""
TIMEOUT_S: Final = 5.0
NOT_SAID: Final = frozenset({"event", "level", "timestamp"})
NOT_TAKEN: Final = (OSError, http.client.HTTPException, ValueError)
"""Errors of an address: no answer, what answers speaks another protocol, or it is no address."""
Post = Callable[[str, bytes], None]


def post(url: str, body: bytes) -> None:
    """Send a message; raise one of `NOT_TAKEN` if the address does not take it."""
    request = urllib.request.Request(url, body, {"Content-Type": "application/json"})  # noqa: S310 - checked by the settings
    with urllib.request.urlopen(request, timeout=TIMEOUT_S):  # noqa: S310 - the settings allow http and https alone
        pass


class Webhook:
    """Collects warnings, and sends them at intervals of `period_s` at least, with the name of the robot."""

    def __init__(self, url: str, period_s: float, robot: str, send: Post = post) -> None:
        self._url, self._period_s, self._robot, self._send = url, period_s, robot, send
        self._lines: deque[dict[str, Any]] = deque(maxlen=LINES_MAX)
        self._came = threading.Event()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._work, name="webhook", daemon=True)

    def on_log(self, entry: Mapping[str, Any]) -> None:
        """Take one line of the log; costs an append."""
        if entry.get("level") in LEVELS:
            self._lines.append(dict(entry))
            self._came.set()

    @contextlib.contextmanager
    def sending(self) -> Iterator[None]:
        """Send during the block; what is left at its end is dropped rather than waited for."""
        self._thread.start()
        try:
            yield
        finally:
            self._done.set()
            self._came.set()

    def _work(self) -> None:
        while not self._done.is_set():
            self._came.wait()
            self._came.clear()
            if self._done.is_set():
                return
            self.send_now()
            self._done.wait(self._period_s)

    def send_now(self) -> None:
        """Send the lines that have come; those of a message that is not taken stay for the next one."""
        lines = [self._lines.popleft() for _ in range(len(self._lines))]
        if not lines:
            return
        words = "\n".join(f"{line['level']}: {_sentence(line)}" for line in lines)
        body = {"text": f"{self._robot}\n{words}", "robot": self._robot, "lines": lines}
        try:
            self._send(self._url, orjson.dumps(body, default=str))
        except NOT_TAKEN:
            later = [self._lines.popleft() for _ in range(len(self._lines))]
            self._lines.extend([*lines, *later])  # of more than fit, the oldest go
            self._came.set()


def _sentence(line: Mapping[str, Any]) -> str:
    return sentence(str(line.get("event", "")), {name: value for name, value in line.items() if name not in NOT_SAID})

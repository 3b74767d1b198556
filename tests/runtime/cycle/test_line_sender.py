"""What a driver sends one by one goes out between cycles, and nothing once the velocity is too old."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from runtime.cycle.line_sender import SEND_AGAIN_S, LineSender
from runtime.timing.run_clock import RunClock
from tests.runtime.virtual_time import VirtualLoop


@dataclass
class OneByOne:
    """A driver that sends a byte at a time; and the line to its robot."""

    loop: VirtualLoop
    due: bytes = b""
    sent: list[tuple[float, bytes]] = field(default_factory=list)
    ticks: int = 0
    line_baud: int | None = None
    is_open: bool = True
    writable: bool = True

    def outgoing(self, *, writable: bool) -> bytes:
        data, self.due = (self.due[:1], self.due[1:]) if writable else (b"", self.due)
        return data

    def tick(self, _run_s: float) -> None:
        self.ticks += 1

    def set_baud(self, _baud: int | None) -> None: ...

    def send(self, data: bytes) -> bool:
        self.sent.append((self.loop.time(), data))
        return True


@pytest.mark.parametrize(
    ("current_s", "expected"), [(1.0, b"abcd"), (2.5 * SEND_AGAIN_S, b"abc"), (-1.0, b"a")], ids=str
)
def test_the_rest_is_sent_with_gaps_while_the_velocity_is_current(current_s: float, expected: bytes) -> None:
    loop = VirtualLoop()
    end, seen = OneByOne(loop, b"abcd"), list[bytes]()
    begin_s = loop.time()

    def on_bytes(way: str, _run_s: float, _host_s: float, data: bytes) -> None:
        assert way == "out"
        seen.append(data)

    sender = LineSender(end, end, RunClock(loop.time), on_bytes, lambda call: call)  # type: ignore[arg-type]
    sender.stale_run_s = begin_s + current_s
    loop.call_soon(sender.send)
    loop.call_later(1.0, loop.stop)
    loop.run_forever()
    loop.close()
    assert b"".join(seen) == b"".join(data for _, data in end.sent) == expected
    assert [s - begin_s for s, _ in end.sent] == pytest.approx([k * SEND_AGAIN_S for k in range(len(expected))])
    assert end.ticks == (len(expected) if expected == b"abcd" else len(expected) - 1)


def test_what_a_cycle_sends_puts_off_what_was_to_follow() -> None:
    loop = VirtualLoop()
    end = OneByOne(loop, b"ab")
    sender = LineSender(end, end, RunClock(loop.time), None, lambda call: call)  # type: ignore[arg-type]
    begin_s = loop.time()
    sender.stale_run_s = begin_s + 1.0
    loop.call_soon(sender.send)

    def again() -> None:
        end.due = b"cd"
        sender.send()

    loop.call_later(0.4 * SEND_AGAIN_S, again)
    loop.call_later(1.0, loop.stop)
    loop.run_forever()
    loop.close()
    assert [round((s - begin_s) / SEND_AGAIN_S, 3) for s, _ in end.sent] == [0.0, 0.4, 1.4]
    assert [data for _, data in end.sent] == [b"a", b"c", b"d"]

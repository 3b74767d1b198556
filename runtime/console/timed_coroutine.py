"""Has every step of a coroutine timed as if it were a callback, so that the books name it where it takes long."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Generator
from types import coroutine
from typing import Any, Protocol, TypeVar

T = TypeVar("T")


class Timed(Protocol):
    """As `runtime.timing.timing_monitor.TimingMonitor.timed`."""

    def __call__(self, name: str, call: Callable[..., Any], /) -> Callable[..., Any]:
        """Return the call as a stretch of that name."""


def untimed(_name: str, call: Callable[..., Any], /) -> Callable[..., Any]:
    """Return the call as it is."""
    return call


@coroutine
def timed_coroutine(timed: Timed, name: str, work: Coroutine[Any, Any, T]) -> Generator[Any, Any, T]:
    """Await `work`, each of its steps timed under `name`."""
    send, throw = timed(name, work.send), timed(name, work.throw)
    step, value = send, None
    try:
        while True:
            try:
                waits_for = step(value)
            except StopIteration as done:
                result: T = done.value
                return result
            value = None
            try:
                value, step = (yield waits_for), send
            except BaseException as error:  # noqa: BLE001 - a cancellation as well is the work's own affair
                value, step = error, throw
    finally:
        work.close()

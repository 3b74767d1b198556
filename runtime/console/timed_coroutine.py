"""Timing of coroutines: each step is measured like a callback, so that long steps appear in the timing table."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Generator
from types import coroutine
from typing import Any, Protocol, TypeVar

T = TypeVar("T")


class Timed(Protocol):
    """As `runtime.timing.timing_monitor.TimingMonitor.timed`."""

    def __call__(self, name: str, call: Callable[..., Any], /) -> Callable[..., Any]:
        """Return a function that does the same and is measured under `name`."""


@coroutine
def timed_coroutine(timed: Timed, name: str, work: Coroutine[Any, Any, T]) -> Generator[Any, Any, T]:
    """Await `work` with each of its steps measured under `name`; return its result.

    The name is that in the timing table. The work, not yet started, is closed at the end.
    """
    resume, resume_with_error = timed(name, work.send), timed(name, work.throw)
    step, value = resume, None
    try:
        while True:
            try:
                waits_for = step(value)
            except StopIteration as done:
                result: T = done.value
                return result
            value = None
            try:
                value, step = (yield waits_for), resume
            except BaseException as error:  # noqa: BLE001 - a cancellation too is for the work to handle
                value, step = error, resume_with_error
    finally:
        work.close()

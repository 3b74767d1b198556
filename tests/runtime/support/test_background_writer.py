"""Tests of the background writer: its queue is bounded, losses are counted, and closing gives up in time."""

from __future__ import annotations

import threading
import time

import pytest

from runtime.support import background_writer
from runtime.support.background_writer import BATCH, CAPACITY, BackgroundWriter


def test_a_writer_that_blocks_fills_no_memory_and_reports_the_gap() -> None:
    started, release, written = threading.Event(), threading.Event(), list[bytes]()

    def write(line: bytes) -> None:
        started.set()
        release.wait()
        written.append(line)

    with BackgroundWriter("log", write, write_gap=lambda count: written.append(b"%d missing\n" % count)) as writer:
        assert writer.put(b"0\n")
        started.wait()
        accepted = [writer.put(b"%d\n" % number) for number in range(1, CAPACITY + 100)]
        assert (accepted.count(True), accepted.count(False)) == (CAPACITY - 1, 100)
        assert writer.is_full
        assert (writer.lost, writer.last_error) == (100, "items come faster than they can be written")
        assert writer.put(b"last\n", always=True), "some items are queued even if the queue is full"
        release.set()
    assert written[:3] == [b"0\n", b"100 missing\n", b"1\n"]
    assert written[-1] == b"last\n"
    assert len(written) == CAPACITY + 2
    assert not writer.is_stuck


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), ValueError("write to closed file")])
def test_an_item_that_cannot_be_written_is_counted_and_the_next_is_tried(error: Exception) -> None:
    written = list[int]()

    def write(number: int) -> None:
        if number % 2:
            raise error
        written.append(number)

    with BackgroundWriter("log", write) as writer:
        for number in range(2 * BATCH):
            writer.put(number)
    assert written == list(range(0, 2 * BATCH, 2))
    assert writer.lost == BATCH
    assert writer.last_error in {"No space left on device", "write to closed file"}


def test_closing_gives_up_on_a_writer_that_blocks() -> None:
    release, finished = threading.Event(), threading.Event()
    writer = BackgroundWriter[int]("log", lambda _: bool(release.wait()), finish=finished.set, close_max_s=0.05)  # type: ignore[arg-type]
    with writer:
        for number in range(3):
            writer.put(number)
    assert writer.is_stuck
    assert writer.lost == 3
    assert writer.last_error == "the last items were not written within 0 s"
    assert not finished.is_set(), "the file stays open as long as a write is under way"
    release.set()
    assert finished.wait(60.0)


def test_a_thread_that_fails_is_reported_and_what_is_queued_counts_as_lost() -> None:
    finished = list[str]()

    def write(_: int) -> None:
        raise ZeroDivisionError("planted")

    with BackgroundWriter("log", write, finish=lambda: finished.append("finish")) as writer:
        writer.put(1)
        while writer.probe() is None:
            time.sleep(0.001)
        writer.put(2)
        assert str(writer.probe()).startswith("ZeroDivisionError: planted")
    assert writer.lost == 2
    assert str(writer.last_error).startswith("its thread failed: ZeroDivisionError: planted")
    assert finished == []


def test_callbacks_run_on_the_thread_in_order() -> None:
    called = list[str]()
    threads = set[str]()

    def note(name: str) -> None:
        called.append(name)
        threads.add(threading.current_thread().name)

    ticked = threading.Event()

    def tick() -> None:
        note("tick")
        ticked.set()

    writer = BackgroundWriter[str](
        "notes", note, begin=lambda: note("begin"), tick=tick, finish=lambda: note("finish"), poll_s=0.001
    )
    with writer:
        assert ticked.wait(60.0), "with a poll interval it ticks without items"
        writer.put("item")
    assert called[:2] == ["begin", "tick"]
    assert called[-1] == "finish"
    assert called.index("item") < len(called) - 2, "a tick follows the last item"
    assert threads == {"notes"}


def test_it_can_be_woken_before_its_interval_ends() -> None:
    written, was_written = list[int](), threading.Event()

    def write(number: int) -> None:
        written.append(number)
        was_written.set()

    with BackgroundWriter("log", write, poll_s=60.0) as writer:
        writer.put(7)
        writer.wake()
        assert was_written.wait(50.0)
    assert written == [7]


def test_a_poll_interval_delays_items(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background_writer, "BATCH_PAUSE_S", 0.0)
    written = list[int]()
    with BackgroundWriter("log", written.append, poll_s=60.0) as writer:
        for number in range(3 * BATCH + 1):
            writer.put(number)
        time.sleep(0.02)
        assert written == [], "no thread is woken for an item"
    assert written == list(range(3 * BATCH + 1)), "closing does not wait for the interval"

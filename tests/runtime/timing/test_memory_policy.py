"""Tests of garbage collection while driving: what was there is excluded, the rest collected in slack only."""

from __future__ import annotations

import gc
import weakref

import pytest

from runtime.timing.memory_policy import EVERY_CYCLES, OLD_EVERY_CYCLES, SLACK_MIN_S, MemoryPolicy

pytestmark = pytest.mark.usefixtures("may_freeze")


class Ring:
    """An object that only a collection frees."""

    def __init__(self) -> None:
        self.itself = self


def rings() -> int:
    # Not isinstance: that asks weak proxies, which other libraries leave behind, for the class of what is gone.
    return sum(type(object_) is Ring for object_ in gc.get_objects())


def test_nothing_is_collected_automatically() -> None:
    memory = MemoryPolicy()
    with memory.driving():
        made = [weakref.ref(Ring()) for _ in range(5000)]
        assert all(ring() is not None for ring in made)
        assert memory.collections == [0, 0, 0]
    assert gc.isenabled()
    # They are young; to look at all objects, as `rings` does, copies what a forked process shares with its parent.
    gc.collect(0)
    assert all(ring() is None for ring in made)


def test_young_garbage_is_collected_in_slack_only() -> None:
    memory = MemoryPolicy()
    with memory.driving():
        for _ in range(3 * EVERY_CYCLES):
            Ring()
            memory.cycle_done(0.5 * SLACK_MIN_S)
        assert memory.collections == [0, 0, 0], "there was no time"
        memory.cycle_done(2.0 * SLACK_MIN_S)
        assert memory.collections == [0, 1, 0]
        assert rings() == 0
        for _ in range(2 * EVERY_CYCLES):
            memory.cycle_done(2.0 * SLACK_MIN_S)
        assert memory.collections == [0, 3, 0]


def test_objects_alive_at_the_start_are_not_visited_again() -> None:
    memory = MemoryPolicy()
    old = [Ring() for _ in range(1000)]
    with memory.driving():
        assert gc.get_freeze_count() >= len(old)
        assert len(gc.get_objects()) < len(old)
    assert gc.get_freeze_count() == 0


def test_garbage_that_was_long_alive_is_collected_within_a_minute_and_what_the_drive_needs_is_not_visited() -> None:
    memory = MemoryPolicy()
    with memory.driving():
        kept = [Ring() for _ in range(1000)]
        for _ in range(OLD_EVERY_CYCLES):
            memory.cycle_done(2.0 * SLACK_MIN_S)
        assert len(gc.get_objects()) < len(kept), "what the first minute has made is excluded"
        page = Ring()
        for _ in range(2 * EVERY_CYCLES):
            memory.cycle_done(2.0 * SLACK_MIN_S)
        del page
        assert rings() == 1
        for _ in range(OLD_EVERY_CYCLES):
            memory.cycle_done(0.5 * SLACK_MIN_S)
        assert rings() == 1, "there was no time"
        memory.cycle_done(2.0 * SLACK_MIN_S)
        assert rings() == 0
        assert memory.collections[-1] == 1


def test_a_collection_requested_elsewhere_is_counted() -> None:
    memory = MemoryPolicy()
    with memory.driving():
        gc.collect()
    assert memory.collections == [0, 0, 1]
    gc.collect(0)
    assert memory.collections == [0, 0, 1], "collections after the drive do not count"


def test_automatic_collection_stays_off_where_it_was_off() -> None:
    gc.disable()
    try:
        with MemoryPolicy().driving():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()

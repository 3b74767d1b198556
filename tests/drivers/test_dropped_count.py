"""What is dropped is said when it is much, and each time it has doubled."""

from __future__ import annotations

from drivers.dropped_count import LATE_FIRINGS, NOTED_FROM, DroppedCount


def test_a_note_comes_with_the_64th_and_with_each_doubling() -> None:
    notes: list[str] = []
    dropped = DroppedCount(LATE_FIRINGS, notes.append)
    for _ in range(NOTED_FROM - 1):
        dropped.add()
    assert notes == []
    for _ in range(NOTED_FROM, 1001):
        dropped.add()
    assert dropped.count == 1000
    assert [int(note.split()[0]) for note in notes] == [64, 128, 256, 512]


def test_many_at_once_are_noted_once() -> None:
    notes: list[str] = []
    dropped = DroppedCount(LATE_FIRINGS, notes.append)
    dropped.add(0)
    dropped.add(500)
    dropped.add(11)
    assert notes == [LATE_FIRINGS.format(500)]

"""What is dropped is said when it is much, and each time it has doubled."""

from __future__ import annotations

import numpy as np

from drivers.dropped_count import LATE_FIRINGS, NOTED_FROM, DroppedCount, MaximumBeyond


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


def test_one_range_beyond_the_window_that_sensors_give_in_turn_is_no_echo() -> None:
    notes: list[str] = []
    maximum = MaximumBeyond(notes.append)
    said = [maximum.is_silence(k % 3, 4.0 + 0.003 * (k % 2), 0.003) for k in range(6)]
    assert said == [False] * 4 + [True] * 2
    assert (len(notes), maximum.is_silence(0, 4.1, 0.003), maximum.is_silence(0, 4.0, 0.003)) == (1, False, True)
    assert "sensors answer 4.000 m in turn" in notes[0]


def test_late_echoes_and_one_sensor_that_repeats_its_range_are_not_taken_for_it() -> None:
    notes: list[str] = []
    late, alone = MaximumBeyond(notes.append), MaximumBeyond(notes.append)
    rng = np.random.default_rng(3)
    assert not any(late.is_silence(k % 8, float(rng.uniform(4.0, 7.0)), 0.01) for k in range(5_000))
    assert not any(alone.is_silence(2, 4.0, 0.003) for _ in range(100))
    assert notes == []

"""The log of objects: what was sure and is gone is logged once, with the reason; an operator's edit is not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
import structlog

from perception.detected_object import DetectedObject
from runtime.cycle.logs.object_log import LINES_BURST, LINES_PER_S, LOOK_S, NO_EVIDENCE, ObjectLog, why_gone

DRUM = DetectedObject("drum", 1.0, 2.0, 0.0, 0.01, 50, 1.0, 0.999, (1e-4, 0.0, 1e-4), 3)
WALL = DetectedObject("wall", 2.0, 0.0, 0.0, 1.0, 90, 1.0, 0.999, (16.0 / 12.0, 0.0, 1e-4), 7)


def logged() -> tuple[ObjectLog, list[dict[str, Any]]]:
    """Return a log and the list of its lines."""
    lines: list[dict[str, Any]] = []

    def keep(_logger: object, _name: str, event: Any) -> Any:
        lines.append(dict(event))
        raise structlog.DropEvent

    return ObjectLog(structlog.wrap_logger(None, processors=[keep])), lines


def seen(*objects: DetectedObject, archived: tuple[DetectedObject, ...] = ()) -> Any:
    return SimpleNamespace(labelled_objects=lambda: objects, archived_objects=lambda: archived)


def test_what_was_sure_and_is_gone_is_logged_once_with_the_reason() -> None:
    log, lines = logged()
    log.observe(seen(DRUM, WALL), 1.0, is_edited=False)
    log.observe(seen(), 1.0 + 0.5 * LOOK_S, is_edited=False)
    assert lines == [], "the map is looked at every ten seconds"
    for k in range(1, 4):
        log.observe(seen(WALL), 1.5 + k * LOOK_S, is_edited=False)
    (line,) = lines
    assert line["event"] == "object gone"
    assert line["object"] == "drum 3 at (1.00, 2.00) m"
    assert line["reason"] == NO_EVIDENCE
    log.observe(seen(), 2.0 + 4.0 * LOOK_S, is_edited=False)
    assert lines[-1]["object"] == "wall 7 at (2.00, 0.00) m, 4.0 m long"


def test_what_is_left_behind_or_goes_with_an_edit_is_not_logged() -> None:
    log, lines = logged()
    log.observe(seen(DRUM, WALL), 1.0, is_edited=False)
    log.observe(seen(WALL, archived=(DRUM,)), 20.0, is_edited=False)
    log.observe(seen(WALL), 25.0, is_edited=True)
    log.observe(seen(WALL), 40.0, is_edited=False)
    assert lines == []


@pytest.mark.parametrize(
    ("gone", "now", "reason"),
    [
        (DRUM, replace(DRUM, probability=0.4), "new readings changed its probability to 40%"),
        (DRUM, replace(DRUM, model="post", probability=0.9), "it is more likely: post; new readings"),
        (DRUM, replace(DRUM, number=9, x=1.1), "it became part of drum 9"),
        (WALL, replace(WALL, number=2, x=2.5), "it became part of wall 2"),
        (DRUM, replace(WALL, number=2, x=1.0, y=2.0), "wall 2 explains its readings better"),
        (WALL, DRUM, NO_EVIDENCE),
    ],
)
def test_the_reason_is_what_the_map_says_now(gone: DetectedObject, now: DetectedObject, reason: str) -> None:
    assert why_gone(gone, (now,)).startswith(reason)


def test_a_map_that_changes_at_every_look_does_not_fill_the_log() -> None:
    log, lines = logged()
    looks = 2000
    for k in range(looks):
        log.observe(seen(*(replace(DRUM, number=10 * k + i) for i in range(5))), k * LOOK_S, is_edited=False)
    assert len(lines) <= LINES_BURST + LINES_PER_S * looks * LOOK_S

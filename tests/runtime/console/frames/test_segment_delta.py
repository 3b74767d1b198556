"""Segments as changes or whole, encoded once for all clients."""

from __future__ import annotations

from typing import Any

import numpy as np
import orjson

from runtime.console.frames.segment_delta import COLUMNS, SegmentDelta


def update(delta: SegmentDelta, numbers: list[int], pinned: tuple[int, ...] = ()) -> dict[str, Any]:
    rows = np.array([[n + 0.00004] * COLUMNS for n in numbers]).reshape(-1, COLUMNS)
    changes = delta.update(np.array(numbers, dtype=np.int64), rows, np.array(pinned, dtype=np.int64))
    return dict(orjson.loads(changes))


def test_changes_are_what_was_added_and_removed() -> None:
    delta = SegmentDelta()
    assert [row[0] for row in update(delta, [1, 2, 3])["added"]] == [1, 2, 3]
    changes = update(delta, [2, 3, 4], pinned=(3,))
    assert changes == {"added": [[4, *[4.0] * COLUMNS]], "removed": [1], "pinned": [3], "whole": False}
    assert orjson.loads(delta.unchanged()) == {"added": [], "removed": [], "pinned": [3], "whole": False}


def test_the_whole_is_the_last_update() -> None:
    delta = SegmentDelta()
    assert orjson.loads(delta.whole()) == {"added": [], "removed": [], "pinned": [], "whole": True}
    update(delta, [7])
    update(delta, [7, 9])
    whole = orjson.loads(delta.whole())
    assert ([row[0] for row in whole["added"]], whole["whole"]) == ([7, 9], True)
    assert delta.whole() is delta.whole(), "encoded once"

"""The known way in frames: encoded once for each change, rounded, and bounded in length."""

from __future__ import annotations

import numpy as np
import orjson
import pytest

from perception.localization.localized_pose import KnownWay
from runtime.console.frames.known_way_row import ROWS_MAX, KnownWayRow

WAY = KnownWay(
    np.array([[0.0, 0.0], [1.23456, 0.5]]),
    np.array([[1.23456, 0.5, 0.0123456789, 0.0, 0.04]]),
    np.array([[0.0, 0.0, 1.23456, 0.5]]),
)


def test_a_way_is_encoded_when_it_changes() -> None:
    row = KnownWayRow()
    assert orjson.loads(row.json) == {"path": [], "maps": [], "loops": []}
    assert not row.update(None)
    assert row.update(WAY)
    assert orjson.loads(row.json) == {
        "path": [[0.0, 0.0], [1.235, 0.5]],
        "maps": [[1.235, 0.5, 0.012346, 0.0, 0.04]],
        "loops": [[0.0, 0.0, 1.235, 0.5]],
    }
    assert not row.update(WAY)
    assert row.update(None), "odometry restarted"
    assert orjson.loads(row.json)["path"] == []


@pytest.mark.parametrize("count", [1, ROWS_MAX, ROWS_MAX + 1, 7 * ROWS_MAX + 3])
def test_a_long_way_is_thinned_and_keeps_its_end(count: int) -> None:
    row, path = KnownWayRow(), np.column_stack([np.arange(count), np.zeros(count)]).astype(np.float64)
    row.update(KnownWay(path, np.zeros((0, 5)), np.zeros((0, 4))))
    sent = np.array(orjson.loads(row.json)["path"])
    assert ROWS_MAX / 2 <= len(sent) <= ROWS_MAX or len(sent) == count
    assert sent[-1].tolist() == path[-1].tolist()
    assert len(set(np.diff(sent[:, 0]))) <= 1

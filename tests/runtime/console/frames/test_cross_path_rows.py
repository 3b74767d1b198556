"""Cross paths of a frame: what was heard, from where, and how many at most."""

from __future__ import annotations

import itertools
import math

import numpy as np
import orjson

from config.load import load_settings
from drivers.firing_pattern import cross_pairs, firing_pattern
from drivers.messages import CrossPaths, Firing, Pose
from runtime.console.frames.cross_path_rows import FIRINGS_MAX, PATHS_MAX, CrossPathRows
from runtime.console.frames.frame_publisher import FRAME_PERIOD_S

BYTES_MAX = 2_000


def firing(robot_s: float, *heard: tuple[int, int, float]) -> Firing:
    """Return a firing in which sensors listened: transmitter, listener, half path."""
    crosses = CrossPaths(*(np.array(column) for column in zip(*heard, strict=True))) if heard else None
    return Firing(robot_s, Pose(1.0, -2.0, 0.123456), 0.5, np.full(3, np.nan), crosses)


def test_a_frame_has_what_was_heard_since_the_last_one_oldest_first() -> None:
    rows = CrossPathRows()
    rows.take(firing(0.1, (0, 2, math.inf), (0, 1, 1.234567)))
    rows.take(firing(0.2))
    rows.take(firing(0.3, (1, 2, math.inf)))
    rows.take(firing(0.4, (2, 1, 2.0)))
    pose = (1.0, -2.0, 0.1235, 0.5)
    assert rows.rows() == [
        {"robot_s": 0.1, "pose": pose, "paths": [(0, 1, 1.2346)]},
        {"robot_s": 0.4, "pose": pose, "paths": [(2, 1, 2.0)]},
    ]
    assert rows.rows() == []


def test_what_a_restarted_robot_heard_before_is_forgotten() -> None:
    rows = CrossPathRows()
    rows.take(firing(0.1, (0, 1, 1.0)))
    rows.clear()
    assert rows.rows() == []


def test_firings_that_no_frame_showed_are_dropped_and_the_newest_paths_kept() -> None:
    rows = CrossPathRows()
    for k in range(100):
        rows.take(firing(k, *((0, listener, 1.0) for listener in range(1, 12))))
    shown = rows.rows()
    assert len(shown) <= FIRINGS_MAX
    assert [row["robot_s"] for row in shown] == [94, 95, 96, 97, 98, 99]
    assert [len(row["paths"]) for row in shown] == [PATHS_MAX % 11, 11, 11, 11, 11, 11]


def test_a_frame_of_sixteen_listeners_is_small() -> None:
    ring = load_settings("hallway", robot="ears").ring
    pattern = firing_pattern(ring)
    axes = tuple(mount.angle_rad for mount in ring.mounts)
    masks = zip(pattern.masks, pattern.listeners, strict=True)
    steps = [[(*pair, 4.56789) for pair in cross_pairs(axes, *masks_)] for masks_ in masks]
    assert {len(step) for step in steps} == {16}
    rows, sizes = CrossPathRows(), []
    between = math.ceil(FRAME_PERIOD_S / pattern.step_period_s)
    for _, heard in zip(range(4 * len(steps)), itertools.cycle(steps), strict=False):
        rows.take(firing(1234.567, *heard))
    assert sum(len(row["paths"]) for row in rows.rows()) == PATHS_MAX
    for heard in steps:
        for _ in range(between):
            rows.take(firing(1234.567, *heard))
        sizes.append(len(orjson.dumps(rows.rows())))
    assert max(sizes) <= BYTES_MAX, sizes

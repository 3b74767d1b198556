"""Lines of sight against plain geometry, and what they promise: nothing behind what is known to stand is free."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.messages import Firing, Floats, Pose
from perception.mapping.grid.sight_lines import (
    COUNT,
    LINES,
    LOCATED,
    LOCATED_PLACES_MIN,
    LOCATED_RAD,
    NOW,
    PLACES_MIN,
    SightLines,
)
from perception.mapping.grid.window import Ring, Window

CELL_M = 0.1
UNKNOWN = np.full(3, math.nan)
MOUNTS = np.array([[0.2, 0.0, 0.0], [0.0, 0.2, 1.7], [-0.2, 0.0, -2.6]])
RING = Ring(MOUNTS, math.radians(12.0), 0.0, 5.0)


def make() -> tuple[SightLines, Window]:
    window = Window(128, CELL_M)
    window.fix(0.0, 0.0)
    return SightLines(window, RING), window


def fire(ranges: list[float], x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Firing:
    return Firing(0.0, Pose(x, y, yaw), yaw, np.array(ranges))


def evidence(lines: SightLines, window: Window) -> Floats:
    """Return the evidence of each cell, row by row from the smallest y."""
    sights = lines.sights.astype(np.float64)
    return window.unrolled(sights[..., [COUNT, LOCATED, LINES, NOW]].sum(axis=2))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_a_passage_counts_up_to_the_first_cell_on_its_line_that_holds_something(seed: int) -> None:
    """Cells well inside one line, and well before or behind what stands there, are as plain geometry has them."""
    rng = np.random.default_rng(seed)
    lines, window = make()
    x, y, yaw = rng.uniform(-1.0, 1.0, 3).tolist()
    holds = np.zeros((128, 128), np.bool_)
    rows, columns = rng.integers(20, 108, (2, 30))
    holds[rows, columns] = True
    corners = CELL_M * window.corner
    stands = corners + CELL_M * (np.column_stack([columns, rows]) + 0.5)
    r = float(rng.uniform(0.5, 4.0))
    lines.observe(fire([r, math.nan, math.nan], x, y, yaw), UNKNOWN, 1, window.rolled(holds))
    found = evidence(lines, window)
    sensor = np.array([x + 0.2 * math.cos(yaw), y + 0.2 * math.sin(yaw)])
    end = r
    centres = CELL_M * (np.stack(np.meshgrid(np.arange(128), np.arange(128)), axis=-1) + 0.5)
    away = corners + centres - sensor
    bearing = np.arctan2(away[..., 1], away[..., 0]) - yaw
    is_outside = np.abs(np.remainder(bearing + math.pi, math.tau) - math.pi) > RING.half_angle + 1e-6
    is_outside |= np.hypot(away[..., 0], away[..., 1]) > end
    assert (found[is_outside] == 0.0).all()
    for row, column in np.argwhere(~is_outside).tolist():
        at = away[row, column]
        d = math.hypot(*at)
        off = abs(math.remainder(math.atan2(at[1], at[0]) - yaw, 2.0 * math.pi))
        towards = at / d
        ahead = (stands - sensor) @ towards
        beside = np.abs((stands - sensor) @ np.array([-towards[1], towards[0]]))
        wide = 0.075 + 0.5 * 2.0 * RING.half_angle / 16 * d
        if not ((beside < wide) & (ahead > -0.1) & (ahead < d + 0.1)).any() and off < RING.half_angle - 1e-6:
            assert found[row, column] > 0.0 or d > end - 0.11
        if ((beside < 0.01) & (ahead > 0.1) & (ahead < d - 0.2) & (ahead < 1.0)).any():
            assert found[row, column] == 0.0


@pytest.mark.covered
@settings(deadline=None, max_examples=12)
@given(st.integers(0, 10_000))
def test_nothing_behind_a_known_wall_is_ever_crossed(seed: int) -> None:
    """Whatever is heard from inside a closed ring of cells, strays and silences, no cell outside it is free."""
    rng = np.random.default_rng(seed)
    lines, window = make()
    rows, columns = np.indices((128, 128))
    away = np.hypot(columns - 64, rows - 64)
    radius = float(rng.uniform(12.0, 30.0))
    holds = (away >= radius) & (away < radius + 1.5)
    for place in range(1, 60):
        x, y = rng.uniform(-0.4, 0.4, 2).tolist()
        ranges = rng.choice([math.inf, rng.uniform(0.3, 5.0), math.nan], 3).tolist()
        bearings = np.where(rng.random(3) < 0.5, rng.uniform(-0.2, 0.2, 3), math.nan)
        yaw = float(rng.uniform(-3.0, 3.0))
        lines.observe(fire(ranges, x, y, yaw), bearings, place, window.rolled(holds))
    found = evidence(lines, window)
    assert found[away < radius].any()
    assert not found[away >= radius + 1.5].any()


@pytest.mark.covered
@pytest.mark.parametrize(
    ("r", "bearing", "has_line", "has_count"),
    [(2.0, 0.0, True, True), (2.0, 0.9 * LOCATED_RAD, True, True), (2.0, 1.5 * LOCATED_RAD, False, True),
     (2.0, math.nan, False, True), (math.inf, math.nan, False, False)],
)  # fmt: skip
def test_an_echo_proves_its_own_line_and_elsewhere_little(
    r: float, bearing: float, *, has_line: bool, has_count: bool
) -> None:  # fmt: skip
    lines, _ = make()
    nothing = np.zeros((128, 128), np.bool_)
    bearings = np.array([bearing, math.nan, math.nan])
    for place in range(1, 9):
        for _ in range(2):  # repeats from one place are one reading
            lines.observe(fire([r, math.nan, math.nan], 0.0, 0.05), bearings, place, nothing)
        if place not in {1, LOCATED_PLACES_MIN, PLACES_MIN - 1, PLACES_MIN, 8}:
            continue
        among_mirrors, elsewhere = (lines.crossed(mirrors)[64, 64 + 12] for mirrors in (1.0, 0.0))
        is_proven = has_line and place >= LOCATED_PLACES_MIN  # one echo may be explained wrongly
        assert among_mirrors == is_proven
        assert elsewhere == (is_proven or (has_count and place >= PLACES_MIN))


def test_a_line_to_something_recognised_is_no_wider_far_away() -> None:
    """A corner's echo from 4 m away opened cells behind the wall that ends there."""
    lines, _ = make()
    for place in range(1, 1 + LOCATED_PLACES_MIN):
        lines.observe(
            fire([3.9, math.nan, math.nan], 0.0, 0.05),
            np.array([0.0, math.nan, math.nan]),
            place,
            np.zeros((128, 128), np.bool_),
        )
    crossed = lines.crossed(1.0)
    far = 64 + 36
    assert math.atan2(2.0, 35.0) < LOCATED_RAD
    assert crossed[64, far]
    assert not crossed[64 + 2, far]


def test_an_echo_from_what_the_grid_holds_opens_its_lines_as_far_as_such_echoes_are_believed() -> None:
    lines, window = make()
    holds = np.zeros((128, 128), np.bool_)
    holds[64, 64 + 22] = True  # 2.05 m before the first sensor
    rolled, among_mirrors = window.rolled(holds), 1.0
    for place in range(1, 40):
        lines.observe(fire([2.05, math.nan, math.nan], 0.0, 0.05), UNKNOWN, place, rolled)
    assert lines.trust > 0.5
    crossed = lines.crossed(among_mirrors)
    assert crossed[64, 64 + 12]
    assert not crossed[64 + 2, 64 + 16], "beside the line, in the beam"
    assert not crossed[64, 64 + 24], "behind what holds"
    for place in range(40, 120):
        lines.observe(fire([4.0, math.nan, math.nan], 0.0, 0.05), UNKNOWN, place, rolled)
    assert lines.trust == 0.0, "most echoes passed over it"
    assert not lines.crossed(among_mirrors).any()
    assert lines.crossed(among_mirrors, 0.5)[64, 64 + 12]


def test_cells_that_come_into_the_window_are_unknown_and_an_impossible_pose_changes_nothing() -> None:
    window = Window(32, CELL_M)
    lines = SightLines(window, RING)
    nothing = np.zeros((32, 32), np.bool_)
    window.follow(Pose(0.0, 0.0, 0.0), ())
    lines.observe(fire([1.0, 1.0, 1.0]), UNKNOWN, 1, nothing)
    before = lines.sights.copy()
    assert before.any()
    lines.observe(fire([1.0, 1.0, 1.0], math.nan), UNKNOWN, 2, nothing)
    np.testing.assert_array_equal(lines.sights, before)
    window.follow(Pose(50.0, 0.0, 0.0), ())
    assert not lines.sights.any()
    lines.observe(fire([1.0, 1.0, 1.0], 50.0), UNKNOWN, 3, nothing)
    lines.clear()
    assert not lines.sights.any()

"""The recordings in tests/data are as their owners describe them; what perception sees in them is asserted there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.recordings import DATA, recording


def test_the_corridor() -> None:
    _, firings = recording("corridor")
    assert len(firings) == 413
    ranges = np.array([f.ranges_m for f in firings])
    fresh = ~np.isnan(ranges)
    assert not fresh[0].any()
    shares = fresh.mean(axis=0)
    assert shares[4] == pytest.approx(0.116, abs=0.001)
    others = np.delete(shares, 4)
    assert others.min() >= 0.30
    assert others.max() <= 0.41
    heard = ranges[np.isfinite(ranges)]
    assert heard.min() >= 0.17
    assert heard.max() <= 5.0
    assert np.allclose(heard * 100.0, np.round(heard * 100.0))
    assert np.isinf(ranges).sum() > 50

    assert firings[0].robot_s == 0.0
    assert firings[-1].robot_s == pytest.approx(92.837)
    places = np.array([(f.pose.x, f.pose.y) for f in firings])
    assert np.hypot(*np.diff(places, axis=0).T).sum() == pytest.approx(25.0, abs=1.0)
    turns = np.abs(np.diff([f.pose.theta for f in firings]))
    assert turns.max() < 0.5, "headings are unwrapped"
    assert all(f.ring_yaw == f.pose.theta for f in firings)


def test_the_corridors_robot_moves_the_way_it_looks() -> None:
    _, firings = recording("corridor")
    steps = np.diff([(f.pose.x, f.pose.y) for f in firings], axis=0)
    theta = np.array([f.pose.theta for f in firings[1:]])
    ahead = steps[:, 0] * np.cos(theta) + steps[:, 1] * np.sin(theta)
    assert ahead.sum() > 0.95 * np.hypot(*steps.T).sum()


def test_the_ring_of_24() -> None:
    _, firings = recording("ring24")
    assert len(firings) == 1000
    ranges = np.array([f.ranges_m for f in firings])
    assert ranges.shape == (1000, 24)
    assert not np.isnan(ranges).any()
    heard = ranges[np.isfinite(ranges)]
    assert heard.min() >= 0.34
    assert heard.max() < 5.0 + 0.09
    assert 0.05 < np.isinf(ranges).mean() < 0.3
    assert firings[9].robot_s == pytest.approx(1.0)
    assert {(f.pose.x, f.pose.y, f.pose.theta) for f in firings} == {(0.0, 0.0, 0.0)}


def test_the_first_firing_of_the_ring_of_24_is_that_of_its_source() -> None:
    """Front, left, back, right and the sensor before the front: US13, US19, US1, US7, US12."""
    firing = recording("ring24")[1][0]
    assert firing.ranges_m[[0, 6, 12, 18, 23]].tolist() == [1.698, 0.504, 0.438, math.inf, 1.687]


def test_source_and_licence_of_each_are_named() -> None:
    text = (DATA / "README.md").read_text("utf-8")
    for path in DATA.glob("*.csv"):
        assert f"## {path.name}:" in text
    assert "MIT licence" in text
    assert "CC BY 4.0" in text
    assert "Copyright (c) 2018 Udacity" in (DATA / "corridor.LICENSE").read_text("utf-8")

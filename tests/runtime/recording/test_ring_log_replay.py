"""A ring log replayed: perception sees every firing in order and finds what it found in the run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config.load import load_settings
from config.units import FOOT_M
from runtime.recording.ring_log import read_ring_log
from runtime.recording.ring_log_replay import FiringReplayer, replay_firings

PAPER = load_settings("hallway", ["perception.method=paper"])
START_FT = -6.0
"""Where the robot starts in the hallway; its odometry counts from there."""


def test_perception_has_seen_each_firing_when_it_is_yielded(hall_log: Path) -> None:
    firings = list(read_ring_log(hall_log))
    replayer, segments = FiringReplayer(PAPER, firings), []
    for k, firing in enumerate(replayer):
        assert firing is firings[k]
        assert replayer.summary()["cycles"] == k + 1
        segments.append(replayer.perception.counts.segments_total)
    assert len(segments) == len(firings) > 200
    assert segments[0] == 0 < segments[-1]
    assert (np.diff(segments) >= 0).all()


@pytest.mark.compiled
def test_the_summary_names_the_drums(hall_log: Path) -> None:
    summary = replay_firings(load_settings("hallway"), read_ring_log(hall_log))
    assert summary["segments"] > 0
    assert summary["clusters"] > 0
    found = [(seen["x"], abs(seen["y"])) for seen in summary["objects"]]
    assert len(found) >= 3
    for x, y in found:
        assert y == pytest.approx(4.0 * FOOT_M, abs=0.1)
        assert min(abs(x - FOOT_M * (drum - START_FT)) for drum in (1.0, 4.0, 7.0)) < 0.1


def test_no_firing_gives_an_empty_summary() -> None:
    summary = replay_firings(PAPER, [])
    assert (summary["objects"], summary["segments"], summary["cycles"]) == ([], 0, 0)

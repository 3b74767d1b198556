"""Codes and capacities of the records that kernels overwrite."""

from __future__ import annotations

from config.robot import SENSORS_MAX
from config.settings import TRACKS_MAX
from perception.bayes.memory.elements import MAX_POLYGONS, PAIRS_PER_SENSOR
from perception.bayes.memory.parameters import BASELINES
from perception.bayes.memory.scratch import POLYGON, PROPOSED, UNEXPLAINED, Scratch


def test_no_two_explanations_of_a_reading_have_the_same_code() -> None:
    polygons = [POLYGON + k for k in range(MAX_POLYGONS)]
    codes = [UNEXPLAINED, PROPOSED, *polygons, *range(TRACKS_MAX)]
    assert len(set(codes)) == len(codes)


def test_all_segments_of_a_firing_fit() -> None:
    """A reading is paired at each baseline and with both neighbours."""
    assert PAIRS_PER_SENSOR >= BASELINES + 2
    assert Scratch.DTYPE["segments"].shape[0] == PAIRS_PER_SENSOR * SENSORS_MAX

"""Tuning numbers of polygons that only work in a certain relation to one another."""

from __future__ import annotations

from perception.bayes.memory import polygon_parameters as p
from perception.bayes.memory.elements import POLYGON_BEARING_BINS, POLYGON_BIN_CAPACITY


def test_twins_overlap_and_a_whole_body_needs_more_room() -> None:
    assert p.TWIN_RADII < p.POLYGONS_APART < p.APART_WHOLE < p.OVERLAP_RADII


def test_a_quantum_holds_the_largest_step_that_cannot_be_cut() -> None:
    """One pose is scored on all the readings of a track, of a body with four sides."""
    readings = POLYGON_BEARING_BINS * POLYGON_BIN_CAPACITY
    assert readings * (p.READING_COST + 4) + p.COLLECTING_COST < p.QUANTUM_COST


def test_a_lattice_of_the_expected_width_is_not_laid_again() -> None:
    assert p.LATTICE_THINNEST < p.LATTICE_NARROW < 1.0 < p.LATTICE_WIDE


def test_a_track_with_many_hits_needs_fewer_sure_ones() -> None:
    assert p.POLYGON_ESTABLISH_HITS < p.MANY_HITS
    assert p.MANY_HITS_SURE < p.POLYGON_ESTABLISH_SURE

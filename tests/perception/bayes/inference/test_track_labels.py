"""Numbers of tracks, marks and rejections by a user, and what they protect a circle from."""

from __future__ import annotations

import numpy as np
import pytest

from perception.bayes.inference import track_labels
from perception.bayes.memory.elements import REJECTIONS_MAX
from perception.bayes.memory.parameters import CENTRE_VARIANCE_MAX_M2
from perception.bayes.memory.state import CONFIRMED, ESTABLISHED, FREE, PLACED, TENTATIVE
from perception.bayes.tracks import refine
from perception.bayes.tracks.archived_tracks import free_row
from tests.perception.bayes.random_tracks import (
    RADII,
    TRACKS,
    P,
    around,
    examples,
    keep,
    new_memory,
    place_of,
    random_track,
)


@examples(200, 1000)
def test_the_free_track_is_the_first_free_one_or_the_unmarked_tentative_one_with_the_least_evidence(
    examples: int,
) -> None:
    rng, memory = np.random.default_rng(12), new_memory()
    circles = memory.circles
    for _ in range(examples):
        for k in range(TRACKS):
            random_track(rng, memory, k, int(rng.choice([FREE, TENTATIVE, ESTABLISHED], p=[0.08, 0.32, 0.6])))
        circles["marks"] = rng.choice([0, PLACED], TRACKS, p=[0.7, 0.3])
        free = np.flatnonzero(circles["status"] == FREE)
        tentative = np.flatnonzero((circles["status"] == TENTATIVE) & (circles["marks"] == 0))
        evidence = circles["log_likelihood_ratio"][tentative]
        weakest = int(tentative[np.argmin(evidence)]) if len(tentative) else -1
        row = int(free[0]) if len(free) else weakest
        assert (track_labels.free_track(memory.tracks), free_row(circles)) == (row, row)


def test_every_new_track_gets_the_next_number_and_no_mark() -> None:
    memory = new_memory()
    for t in (3, 5, 3):
        memory.circles["marks"][t] = CONFIRMED
        track_labels.assign_number(memory.s, memory.tracks[t])
    assert memory.circles["number"][[3, 5]].tolist() == [3, 2]
    assert memory.circles["marks"][[3, 5]].tolist() == [0, 0]
    assert memory.state["objects_numbered"][0] == 3


def test_a_rejection_holds_for_its_kind_its_place_and_less_evidence() -> None:
    memory = new_memory()

    def is_rejected(x: float, y: float, what: int, evidence_nat: float) -> bool:
        return track_labels.is_rejected(memory.s, x, y, what, evidence_nat)

    assert not is_rejected(1.0, 1.0, 0, -1e9)
    for k in range(REJECTIONS_MAX + 3):
        memory.state["rejections"][0, k % REJECTIONS_MAX] = (float(k), 0.0, 0.3, 7, 40.0)
        memory.state["rejection_count"] += 1
    at = float(REJECTIONS_MAX + 2)
    assert is_rejected(at + 0.2, 0.2, 7, 39.9)
    assert not is_rejected(at + 0.2, 0.2, 7, 40.0)
    assert not is_rejected(at + 0.2, 0.2, 8, 0.0)
    assert not is_rejected(at + 0.2, 0.25, 7, 0.0)
    assert not is_rejected(0.0, 0.0, 7, 0.0), "the newest rejection replaced the oldest"
    assert is_rejected(3.0, 0.0, 7, 0.0)


def test_a_track_without_support_is_freed_unless_a_user_marked_it() -> None:
    memory = new_memory()
    for mark, status in ((0, FREE), (CONFIRMED, TENTATIVE), (PLACED, TENTATIVE)):
        memory.circles["status"], memory.circles["marks"] = ESTABLISHED, mark
        assert track_labels.drop_track(memory.tracks[0]) == (status == FREE)
        assert memory.circles["status"][0] == status


@pytest.mark.parametrize(
    ("marks", "has_more", "numbers", "stays", "after"),
    [
        ((0, 0), True, (5, 3), True, (3, 3)),
        ((0, 0), False, (3, 5), False, (3, 3)),
        ((CONFIRMED, 0), False, (5, 3), True, (5, 3)),
        ((0, PLACED), True, (3, 5), False, (3, 5)),
        ((CONFIRMED, PLACED), True, (5, 3), True, (5, 3)),
        ((CONFIRMED, PLACED), False, (3, 5), False, (3, 5)),
    ],
)
def test_of_two_tracks_the_marked_one_stays_with_its_number_else_the_one_with_more_evidence_with_the_older_number(
    marks: tuple[int, int], has_more: bool, numbers: tuple[int, int], stays: bool, after: tuple[int, int]
) -> None:
    memory = new_memory()
    circles = memory.circles
    circles["marks"][:2], circles["number"][:2] = marks, numbers
    assert track_labels.outlives(memory.tracks[0], memory.tracks[1], has_more) == stays
    assert tuple(circles["number"][:2].tolist()) == after


@pytest.mark.parametrize("mark", [CONFIRMED, PLACED, CONFIRMED | PLACED])
def test_no_reading_ends_a_circle_that_a_user_marked_nor_makes_it_something_else(mark: int) -> None:
    rng, memory = np.random.default_rng(mark), new_memory()
    circles, track = memory.circles, memory.tracks[0]
    tentative = 0
    for turn in range(15):
        circles.view(np.uint8)[...] = 0
        random_track(rng, memory, 0, int(rng.choice([TENTATIVE, ESTABLISHED])))
        track.root_xx = track.root_yy = 0.01
        track.number, track.marks = 9, mark
        kind, radius = int(track.kind), float(track.radius)
        w = around(rng, int(rng.integers(0, 60)), place_of(memory, 0), float(rng.choice([radius, 0.6, 0.0])))
        if turn % 3 == 0:  # something stands before it
            w[:, 4] = np.abs(w[:, 2]) * 0.5
        keep(memory, 0, w)
        refine.refine(memory.s, memory.tracks, P, 0)
        assert track.status != FREE
        assert track.kind == kind
        assert track.number == 9
        assert track.marks & CONFIRMED == mark & CONFIRMED
        tentative += track.status == TENTATIVE
    assert tentative > 2


@pytest.mark.parametrize("marks", [0, PLACED])
def test_a_track_that_a_user_placed_stays_where_it_is_until_its_readings_support_it(marks: int) -> None:
    """The echoes of another body, from one side, lead a track to it, and a placed one nowhere."""
    memory = new_memory()
    track = memory.tracks[0]
    track.kind, track.radius, track.number, track.marks = 0, RADII[0], 1, marks
    track.x, track.y, track.status, track.root_xx, track.root_yy = 1.0, 0.0, TENTATIVE, 0.1, 0.1
    sensors, body = np.column_stack([np.full(12, -0.5), np.linspace(-0.3, 0.3, 12)]), np.array([1.2, 0.0])
    off = body - sensors
    away = np.hypot(*off.T)
    keep(memory, 0, np.column_stack([sensors, off / away[:, None], away - RADII[0]]))
    for _ in range(10):
        refine.refine(memory.s, memory.tracks, P, 0)
    assert track.is_named == 0
    if marks == PLACED:
        assert (track.x, track.y, track.marks) == (1.0, 0.0, PLACED)
        assert track.covariance_xx == CENTRE_VARIANCE_MAX_M2
    else:
        assert track.x > 1.1 or track.status == FREE

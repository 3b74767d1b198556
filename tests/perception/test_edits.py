"""Operators' edits by both methods: each takes effect and lasts as long as it should."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.messages import Firing
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    MoveObject,
    PinSegments,
    PlaceModel,
    RemoveObject,
)
from perception.pipeline import Perception
from tests.perception.edited import (
    DRUM,
    EARLY,
    again,
    at,
    hear,
    is_bayes,
    number_of,
    passed,
    settle,
    there,
)

# Numbers.


@pytest.mark.covered
def test_objects_and_segments_keep_their_numbers(seen: Perception, firings: list[Firing]) -> None:
    before = {o.number: (o.x, o.y) for o in seen.objects()}
    assert len(before) >= 4
    assert None not in before
    kept = dict(zip(seen.segments().numbers.tolist(), seen.segments().geometry.tolist(), strict=True))
    assert len(kept) == len(seen.segments().numbers) == seen.counts.segments
    assert all(n > 0 for n in kept)
    for firing in again(firings):
        hear(seen, firing)
    for o in seen.objects():
        if o.number in before:
            assert math.dist(before[o.number], (o.x, o.y)) < 0.1
    assert len(before.keys() & {o.number for o in seen.objects()}) >= 4
    listed = seen.segments()
    after = dict(zip(listed.numbers.tolist(), listed.geometry.tolist(), strict=True))
    assert len(after) == len(listed.numbers)
    common = kept.keys() & after.keys()
    assert common
    assert all(kept[n] == after[n] for n in common)
    assert max(after) > max(kept), "new segments have new numbers"
    times = listed.times
    assert np.isfinite(times).all()
    assert (times <= firings[-1].robot_s).all()
    np.testing.assert_array_equal(listed.geometry, seen.segment_geometry())


# Segments.


def test_deleting_segments_leaves_the_others_unchanged(seen: Perception) -> None:
    numbers, ends, times, _ = seen.segments()
    doomed, total = tuple(numbers[::3].tolist()), seen.counts.segments_total
    assert seen.edit(DeleteSegments(doomed)) is None
    left = seen.segments()
    stays = ~np.isin(numbers, doomed)
    assert seen.counts.segments == stays.sum()
    assert seen.counts.segments_total == total
    order, was = np.argsort(left.numbers), np.argsort(numbers[stays])
    np.testing.assert_array_equal(left.numbers[order], numbers[stays][was])
    np.testing.assert_array_equal(left.geometry[order], ends[stays][was])
    np.testing.assert_array_equal(left.times[order], times[stays][was])
    refused = seen.edit(DeleteSegments((doomed[0], int(numbers[1]))))
    assert refused is not None
    assert f"segment {doomed[0]};" in refused
    assert int(numbers[1]) not in seen.segments().numbers, "the other segment was deleted"
    refused = seen.edit(DeleteSegments(doomed))
    assert refused is not None
    assert f"and {len(doomed) - 5} more" in refused


@pytest.mark.compiled
def test_pinned_segments_stay_until_unpinned(seen: Perception, firings: list[Firing]) -> None:
    listed = seen.segments()
    pins = tuple(listed.numbers[np.argsort(listed.times)][:: max(1, len(listed.numbers) // 12)].tolist())
    assert seen.edit(PinSegments(pins, pinned=True)) is None
    assert set(seen.segments().numbers[seen.segments().pinned == 1].tolist()) == set(pins)
    rows = {n: tuple(e) for n, e in zip(listed.numbers.tolist(), listed.geometry.tolist(), strict=True) if n in pins}
    for lap in range(1, 4):
        for firing in passed(firings):
            seen.observe(replace(firing, robot_s=firing.robot_s + 200.0 * lap))
    after = seen.segments()
    now = {n: tuple(e) for n, e in zip(after.numbers.tolist(), after.geometry.tolist(), strict=True)}
    assert {n: now.get(n) for n in pins} == rows
    assert set(after.numbers[after.pinned == 1].tolist()) == set(pins)
    gone = set(listed.numbers.tolist()) - set(pins) - set(after.numbers.tolist())
    assert gone, "others have left meanwhile"
    assert seen.edit(PinSegments(pins, pinned=False)) is None
    assert not seen.segments().pinned.any()
    for lap in range(4, 8):
        for firing in passed(firings):
            seen.observe(replace(firing, robot_s=firing.robot_s + 200.0 * lap))
    assert not set(pins) <= set(seen.segments().numbers.tolist()), "unpinned segments leave like any other"


def test_segments_that_are_not_in_the_map_cannot_be_pinned(seen: Perception) -> None:
    known = int(seen.segments().numbers[0])
    refused = seen.edit(PinSegments((known, 10**9), pinned=True))
    assert refused is not None
    assert "segment 1000000000" in refused
    assert seen.segments().pinned.sum() == 1
    assert seen.edit(PinSegments((known,), pinned=True)) is None, "twice is once"
    assert seen.segments().pinned.sum() == 1
    assert seen.edit(DeleteSegments((known,))) is None
    assert seen.segments().pinned.sum() == 0
    refused = seen.edit(PinSegments((known,), pinned=False))
    assert refused is not None
    assert f"segment {known}" in refused


# Objects.


@pytest.mark.parametrize(("off_x", "off_y"), [(0.12, 0.0), (-0.05, -0.1), (0.0, 0.0)])
def test_a_placed_model_relaxes_onto_the_readings(seen: Perception, off_x: float, off_y: float) -> None:
    """The paper's method relaxes it onto segments, the Bayesian method onto readings."""
    rested = there(seen)
    assert seen.edit(RemoveObject(number_of(rested))) is None
    settle(seen)
    assert at(seen, DRUM) is None
    if is_bayes(seen):
        return  # it forgot the readings with the object: see below
    assert seen.edit(PlaceModel("drum", rested.x + off_x, rested.y + off_y, rested.theta + 0.1)) is None
    settle(seen)
    found = there(seen)
    assert (found.placed, found.confirmed) == (True, False)
    assert math.dist((found.x, found.y), (rested.x, rested.y)) < 0.06
    assert found.support >= 0.8 * rested.support
    assert found.number not in {None, rested.number}


@pytest.mark.covered
@pytest.mark.parametrize("model", ["drum", "box"])
def test_a_placed_model_is_reported_at_once_and_stays(seen: Perception, firings: list[Firing], model: str) -> None:
    """It is placed on the driven path, where many readings show free space."""
    before = {o.number for o in seen.objects()}
    assert seen.edit(PlaceModel(model, 0.4, 0.1, 0.3)) is None
    (new,) = [o for o in seen.objects() if o.number not in before]
    assert (new.model, new.placed, new.confirmed) == (model, True, False)
    assert math.dist((new.x, new.y), (0.4, 0.1)) < 0.55
    assert math.isfinite(new.sigma)
    assert new.sigma > 0.0
    for firing in again(firings):
        hear(seen, firing)
    (still,) = [o for o in seen.objects() if o.number == new.number]
    assert still.placed
    assert still.score < 0.5
    evidence = seen.evidence(number_of(new))
    assert evidence is not None
    assert evidence.model == model
    assert evidence.opposing <= 0.0
    if is_bayes(seen):
        assert evidence.opposing < -10.0
        assert still.probability is not None
        assert still.probability < 0.1
    assert seen.edit(RemoveObject(number_of(new))) is None
    assert new.number not in {o.number for o in seen.objects()}


@pytest.mark.covered
def test_a_moved_object_keeps_its_number_and_relaxes_back(seen: Perception, firings: list[Firing]) -> None:
    rested = there(seen)
    number = number_of(rested)
    assert seen.edit(MoveObject(number, rested.x + 0.08, rested.y - 0.06, rested.theta)) is None
    (moved,) = [o for o in seen.objects() if o.number == number]
    assert moved.placed
    for firing in again(firings):
        hear(seen, firing)
    (found,) = [o for o in seen.objects() if o.number == number]
    assert math.dist((found.x, found.y), (rested.x, rested.y)) < 0.03
    assert [o for o in seen.objects() if math.dist((o.x, o.y), DRUM) < 0.3] == [found], "there is one there"
    if is_bayes(seen):
        assert not found.placed, "the readings bear it out by themselves"
        assert found.probability is not None
        assert found.probability > 0.9


def test_an_object_moved_far_away_is_judged_by_the_readings_there(seen: Perception) -> None:
    rested = there(seen)
    number = number_of(rested)
    assert seen.edit(MoveObject(number, 0.4, 0.0, 0.0)) is None
    settle(seen)
    (found,) = [o for o in seen.objects() if o.number == number]
    assert math.dist((found.x, found.y), (0.4, 0.0)) < 0.6
    assert found.placed
    assert seen.edit(MoveObject(number, rested.x, rested.y, rested.theta)) is None
    settle(seen)
    (found,) = [o for o in seen.objects() if o.number == number]
    assert math.dist((found.x, found.y), (rested.x, rested.y)) < 0.1


@pytest.mark.compiled
def test_only_new_readings_bring_a_rejected_object_back(seen: Perception, firings: list[Firing]) -> None:
    number = number_of(there(seen))
    others = {o.number for o in seen.objects()} - {number}
    assert seen.edit(RemoveObject(number)) is None
    assert at(seen, DRUM, 0.3) is None
    assert {o.number for o in seen.objects()} >= others
    settle(seen)
    assert at(seen, DRUM, 0.3) is None
    last = list(passed(firings))[-1]
    for k in range(20):
        hear(seen, replace(last, robot_s=last.robot_s + 0.05 * k))
    assert at(seen, DRUM, 0.3) is None, "a robot at rest gets no new evidence"
    back = None
    for firing in again(firings):
        hear(seen, firing)
        back = back or at(seen, DRUM)
    assert back is not None, "it is there, and is heard again"
    assert seen.edit(RemoveObject(number)) is not None
    if is_bayes(seen):
        assert back.number != number


@pytest.mark.compiled
def test_a_confirmed_object_is_reported_whatever_its_evidence(
    reached_drums: Perception, firings: list[Firing]
) -> None:
    """The Bayesian method, early: a track resembles a drum but is not certain enough to be reported as one."""
    seen = reached_drums
    doubtful = [o for o in seen.labelled_objects() if o.model == "unknown"]
    assert doubtful
    number = number_of(doubtful[0])
    assert number not in {o.number for o in seen.objects()}
    assert seen.edit(ConfirmObject(number)) is None
    (found,) = [o for o in seen.objects() if o.number == number]
    assert (found.model, found.confirmed, found.placed) == ("drum", True, False)
    assert found.probability is not None
    assert found.probability < 0.8
    for firing in firings[EARLY:]:
        hear(seen, replace(firing, ranges_m=np.where(np.isfinite(firing.ranges_m), np.inf, firing.ranges_m)))
    (found,) = [o for o in seen.objects() if o.number == number]
    assert found.confirmed
    assert found.probability is not None
    assert found.probability < 0.5, "all is silent since: nothing speaks for it any more"
    assert seen.edit(RemoveObject(number)) is None
    assert number not in {o.number for o in seen.objects()}


def test_a_confirmed_object_of_the_papers_method_outlasts_its_segments(seen: Perception) -> None:
    if is_bayes(seen):
        return
    rested = there(seen)
    number = number_of(rested)
    assert seen.edit(ConfirmObject(number)) is None
    found = there(seen)
    assert (found.number, found.confirmed, found.placed) == (number, True, False)
    assert (found.x, found.y) == (rested.x, rested.y)
    assert seen.edit(ConfirmObject(number)) is None, "twice is once"
    assert seen.edit(DeleteSegments(tuple(seen.segments().numbers.tolist()))) is None
    settle(seen)
    assert [(o.number, o.support, o.score) for o in seen.objects()] == [(number, 0, 0.0)]
    moved = MoveObject(number, 1.0, 1.0, 0.0)
    assert seen.edit(moved) is None
    (found,) = seen.objects()
    assert (found.x, found.y, found.confirmed) == (1.0, 1.0, True)
    assert seen.edit(RemoveObject(number)) is None
    assert seen.objects() == ()


@pytest.mark.compiled
def test_clearing_the_map_keeps_number_counters_and_obstacles(seen: Perception, firings: list[Firing]) -> None:
    numbers, listed = {o.number for o in seen.objects()}, set(seen.segments().numbers.tolist())
    assert seen.edit(PinSegments(tuple(listed)[:2], pinned=True)) is None
    obstacles = seen.obstacles(firings[-1].robot_s, 1e9)
    assert len(obstacles) > 3
    assert seen.edit(ClearMap()) is None
    assert (seen.objects(), seen.counts.segments, seen.counts.hypotheses, seen.can_refine) == ((), 0, 0, False)
    assert len(seen.segments().numbers) == 0
    np.testing.assert_array_equal(seen.obstacles(firings[-1].robot_s, 1e9), obstacles)
    for firing in passed(firings):
        hear(seen, replace(firing, robot_s=firing.robot_s + 100.0))
    assert len(seen.objects()) >= 4
    assert numbers.isdisjoint({o.number for o in seen.objects()})
    assert listed.isdisjoint(seen.segments().numbers.tolist())

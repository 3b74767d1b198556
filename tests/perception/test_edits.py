"""What a person does to what was perceived, by both methods: it is done, it lasts as it should, and it is told."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from config.load import load_model, load_settings, load_world
from config.settings import Settings
from drivers.messages import Firing
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    Edit,
    MoveObject,
    PinSegments,
    PlaceModel,
    RejectObject,
)
from perception.pipeline import Perception, SeenObject
from perception.snapshot import Snapshot
from tests.perception.halls import FT, drive

EARLY = 61
"""Firings until the first drums are in sight."""
SEEN_TO_FT = 6.0
"""The drive ends here, with four drums in sight or just passed."""
DRUM = (1.0 * FT, 4.0 * FT)
METHODS = ("paper", "full")


def settings_of(method: str) -> Settings:
    return load_settings("hallway", [f"perception.method={method}"], models=("semicircle", "box"))


SETTINGS = {method: settings_of(method) for method in METHODS}


@pytest.fixture(scope="module")
def firings() -> list[Firing]:
    """A way past the first four drums, and 3 ft of it once more."""
    once = list(drive(load_world("hallway"), (-4.0, SEEN_TO_FT)))
    return [*once, *drive(load_world("hallway"), (-1.0, 3.0), begin_s=once[-1].t_s + 1.0, y_ft=0.5)]


@pytest.fixture(scope="module", params=["paper", pytest.param("full", marks=pytest.mark.compiled)])
def remembered(request: pytest.FixtureRequest, firings: list[Firing]) -> tuple[str, Snapshot]:
    """Return a method, and what it remembers after that way."""
    perception = fresh(request.param)
    for firing in passed(firings):
        hear(perception, firing)
    return request.param, perception.snapshot()


@pytest.fixture(scope="module")
def early(firings: list[Firing]) -> Snapshot:
    """Return what the full method remembers when it has come to the first drums."""
    perception = fresh("full")
    for firing in firings[:EARLY]:
        hear(perception, firing)
    return perception.snapshot()


def passed(firings: list[Firing]) -> Iterator[Firing]:
    return (f for f in firings if f.pose.y == 0.0)


def again(firings: list[Firing]) -> Iterator[Firing]:
    return (f for f in firings if f.pose.y != 0.0)


def fresh(method: str) -> Perception:
    chosen = SETTINGS[method]
    return Perception(chosen.ring, chosen.models, chosen.perception)


def hear(perception: Perception, firing: Firing) -> None:
    perception.observe(firing)
    settle(perception)


def settle(perception: Perception) -> None:
    while perception.pending and perception.refine():
        pass


@pytest.fixture
def seen(remembered: tuple[str, Snapshot]) -> Perception:
    method, memory = remembered
    perception = fresh(method)
    perception.restore(memory)
    return perception


@pytest.fixture
def begun(early: Snapshot) -> Perception:
    perception = fresh("full")
    perception.restore(early)
    return perception


def at(perception: Perception, place: tuple[float, float], within_m: float = 0.15) -> SeenObject | None:
    """Return the object at a place, None where there is none."""
    near = [o for o in perception.objects() if math.dist((o.x, o.y), place) < within_m]
    return min(near, key=lambda o: math.dist((o.x, o.y), place)) if near else None


def there(perception: Perception, place: tuple[float, float] = DRUM) -> SeenObject:
    found = at(perception, place)
    assert found is not None, perception.objects()
    return found


def number_of(seen: SeenObject) -> int:
    assert seen.number is not None
    return seen.number


def is_full(perception: Perception) -> bool:
    return type(perception.method).__name__ == "FullPerception"


# Numbers.


def test_objects_and_segments_keep_their_numbers(seen: Perception, firings: list[Firing]) -> None:
    before = {o.number: (o.x, o.y) for o in seen.objects()}
    assert len(before) >= 4
    assert None not in before
    kept = dict(zip(seen.segments().numbers.tolist(), seen.segments().ends.tolist(), strict=True))
    assert len(kept) == len(seen.segments().numbers) == seen.living
    assert all(n > 0 for n in kept)
    for firing in again(firings):
        hear(seen, firing)
    for o in seen.objects():
        if o.number in before:
            assert math.dist(before[o.number], (o.x, o.y)) < 0.1
    assert len(before.keys() & {o.number for o in seen.objects()}) >= 4
    listed = seen.segments()
    after = dict(zip(listed.numbers.tolist(), listed.ends.tolist(), strict=True))
    assert len(after) == len(listed.numbers)
    common = kept.keys() & after.keys()
    assert common
    assert all(kept[n] == after[n] for n in common)
    assert max(after) > max(kept), "new ones have new numbers"
    times = listed.times
    assert np.isfinite(times).all()
    assert (times <= firings[-1].t_s).all()
    np.testing.assert_array_equal(listed.ends, seen.segments_now())


# Segments.


def test_deleted_segments_are_gone_and_the_rest_is_as_it_was(seen: Perception) -> None:
    numbers, ends, times, _ = seen.segments()
    doomed, total = tuple(numbers[::3].tolist()), seen.total
    assert seen.edit(DeleteSegments(doomed)) is None
    left = seen.segments()
    stays = ~np.isin(numbers, doomed)
    assert seen.living == stays.sum()
    assert seen.total == total
    order, was = np.argsort(left.numbers), np.argsort(numbers[stays])
    np.testing.assert_array_equal(left.numbers[order], numbers[stays][was])
    np.testing.assert_array_equal(left.ends[order], ends[stays][was])
    np.testing.assert_array_equal(left.times[order], times[stays][was])
    refused = seen.edit(DeleteSegments((doomed[0], int(numbers[1]))))
    assert refused is not None
    assert f"segment {doomed[0]};" in refused
    assert int(numbers[1]) not in seen.segments().numbers, "the other one is done"
    refused = seen.edit(DeleteSegments(doomed))
    assert refused is not None
    assert f"and {len(doomed) - 5} more" in refused


def test_pinned_segments_outlast_whatever_comes(seen: Perception, firings: list[Firing]) -> None:
    listed = seen.segments()
    pins = tuple(listed.numbers[np.argsort(listed.times)][:: max(1, len(listed.numbers) // 12)].tolist())
    assert seen.edit(PinSegments(pins, pinned=True)) is None
    assert set(seen.segments().numbers[seen.segments().pinned == 1].tolist()) == set(pins)
    rows = {n: tuple(e) for n, e in zip(listed.numbers.tolist(), listed.ends.tolist(), strict=True) if n in pins}
    for lap in range(1, 4):
        for firing in passed(firings):
            seen.observe(replace(firing, t_s=firing.t_s + 200.0 * lap))
    after = seen.segments()
    now = {n: tuple(e) for n, e in zip(after.numbers.tolist(), after.ends.tolist(), strict=True)}
    assert {n: now.get(n) for n in pins} == rows
    assert set(after.numbers[after.pinned == 1].tolist()) == set(pins)
    gone = set(listed.numbers.tolist()) - set(pins) - set(after.numbers.tolist())
    assert gone, "others have left meanwhile"
    assert seen.edit(PinSegments(pins, pinned=False)) is None
    assert not seen.segments().pinned.any()
    for lap in range(4, 8):
        for firing in passed(firings):
            seen.observe(replace(firing, t_s=firing.t_s + 200.0 * lap))
    assert not set(pins) <= set(seen.segments().numbers.tolist()), "let go, they leave as any other"


def test_what_is_not_in_the_map_cannot_be_pinned(seen: Perception) -> None:
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
def test_a_model_that_is_placed_relaxes_onto_what_was_heard(seen: Perception, off_x: float, off_y: float) -> None:
    """The paper's method has segments of its own for it, the full one readings."""
    rested = there(seen)
    assert seen.edit(RejectObject(number_of(rested))) is None
    settle(seen)
    assert at(seen, DRUM) is None
    if is_full(seen):
        return  # it forgot the readings with the object: see below
    assert seen.edit(PlaceModel("semicircle", rested.x + off_x, rested.y + off_y, rested.theta + 0.1)) is None
    settle(seen)
    found = there(seen)
    assert (found.placed, found.confirmed) == (True, False)
    assert math.dist((found.x, found.y), (rested.x, rested.y)) < 0.06
    assert found.support >= 0.8 * rested.support
    assert found.number not in {None, rested.number}


@pytest.mark.parametrize("model", ["semicircle", "box"])
def test_a_model_that_is_placed_is_there_at_once_and_stays(
    seen: Perception, firings: list[Firing], model: str
) -> None:
    """In the middle of the way, where nothing is and much was heard to say so."""
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
    if is_full(seen):
        assert evidence.opposing < -10.0
        assert still.probability is not None
        assert still.probability < 0.1
    assert seen.edit(RejectObject(number_of(new))) is None
    assert new.number not in {o.number for o in seen.objects()}


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
    if is_full(seen):
        assert not found.placed, "the readings bear it out by themselves"
        assert found.probability is not None
        assert found.probability > 0.9


def test_an_object_moved_far_away_is_judged_by_what_was_heard_there(seen: Perception) -> None:
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


def test_a_rejected_object_is_gone_and_only_new_readings_bring_it_back(
    seen: Perception, firings: list[Firing]
) -> None:
    number = number_of(there(seen))
    others = {o.number for o in seen.objects()} - {number}
    assert seen.edit(RejectObject(number)) is None
    assert at(seen, DRUM, 0.3) is None
    assert {o.number for o in seen.objects()} >= others
    settle(seen)
    assert at(seen, DRUM, 0.3) is None
    last = list(passed(firings))[-1]
    for k in range(20):
        hear(seen, replace(last, t_s=last.t_s + 0.05 * k))
    assert at(seen, DRUM, 0.3) is None, "standing where it stood the robot hears nothing new"
    back = None
    for firing in again(firings):
        hear(seen, firing)
        back = back or at(seen, DRUM)
    assert back is not None, "it is there, and is heard again"
    assert seen.edit(RejectObject(number)) is not None
    if is_full(seen):
        assert back.number != number


def test_a_confirmed_object_is_reported_however_little_speaks_for_it(
    begun: Perception, firings: list[Firing]
) -> None:
    """The full method, early on: something is about to be a drum, and is not sure enough to be called one."""
    seen = begun
    doubtful = [o for o in seen.things() if o.model == "unknown"]
    assert doubtful
    number = number_of(doubtful[0])
    assert number not in {o.number for o in seen.objects()}
    assert seen.edit(ConfirmObject(number)) is None
    (found,) = [o for o in seen.objects() if o.number == number]
    assert (found.model, found.confirmed, found.placed) == ("semicircle", True, False)
    assert found.probability is not None
    assert found.probability < 0.8
    for firing in firings[EARLY:]:
        hear(seen, replace(firing, ranges_m=np.where(np.isfinite(firing.ranges_m), np.inf, firing.ranges_m)))
    (found,) = [o for o in seen.objects() if o.number == number]
    assert found.confirmed
    assert found.probability is not None
    assert found.probability < 0.5, "all is silent since: nothing speaks for it any more"
    assert seen.edit(RejectObject(number)) is None
    assert number not in {o.number for o in seen.objects()}


def test_a_confirmed_object_of_the_papers_method_outlasts_its_segments(seen: Perception) -> None:
    if is_full(seen):
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
    assert seen.edit(RejectObject(number)) is None
    assert seen.objects() == ()


def test_after_the_map_is_cleared_all_begins_anew_but_numbers_and_obstacles(
    seen: Perception, firings: list[Firing]
) -> None:
    numbers, listed = {o.number for o in seen.objects()}, set(seen.segments().numbers.tolist())
    assert seen.edit(PinSegments(tuple(listed)[:2], pinned=True)) is None
    obstacles = seen.obstacles(firings[-1].t_s, 1e9)
    assert len(obstacles) > 3
    assert seen.edit(ClearMap()) is None
    assert (seen.objects(), seen.living, seen.hypotheses, seen.pending) == ((), 0, 0, False)
    assert len(seen.segments().numbers) == 0
    np.testing.assert_array_equal(seen.obstacles(firings[-1].t_s, 1e9), obstacles)
    for firing in passed(firings):
        hear(seen, replace(firing, t_s=firing.t_s + 100.0))
    assert len(seen.objects()) >= 4
    assert numbers.isdisjoint({o.number for o in seen.objects()})
    assert listed.isdisjoint(seen.segments().numbers.tolist())


NOWHERE = 999_999
REFUSED: list[tuple[Edit, str]] = [
    (MoveObject(NOWHERE, 0.0, 0.0, 0.0), "no object 999999"),
    (RejectObject(NOWHERE), "no object 999999"),
    (ConfirmObject(NOWHERE), "no object 999999"),
    (RejectObject(0), "nothing has the number 0"),
    (ConfirmObject(-3), "nothing has the number -3"),
    (MoveObject(2**80, 0.0, 0.0, 0.0), "nothing has the number"),
    (DeleteSegments((1, 2**80)), "nothing has the number"),
    (PinSegments((-(2**80),), pinned=True), "nothing has the number"),
    (PlaceModel("chair", 0.0, 0.0, 0.0), "no model is called chair"),
    (PlaceModel("semicircle", math.nan, 0.0, 0.0), "is no place"),
    (PlaceModel("box", 0.0, math.inf, 0.0), "is no place"),
    (PlaceModel("box", 0.0, 1e9, 0.0), "is no place"),
    (MoveObject(1, 0.0, 0.0, math.nan), "is no place"),
]


@pytest.mark.parametrize(("edit", "why"), REFUSED, ids=lambda v: v if isinstance(v, str) else v.kind)
def test_what_cannot_be_done_is_said_and_changes_nothing(seen: Perception, edit: Edit, why: str) -> None:
    before = seen.snapshot()
    refused = seen.edit(edit)
    assert refused is not None
    assert why in refused
    assert refused.isprintable()
    after = seen.snapshot()
    assert all(np.array_equal(before[name], after[name], equal_nan=before[name].dtype.kind == "f") for name in before)
    assert seen.evidence(NOWHERE) is None


def test_there_is_room_for_so_many_and_a_word_on_it(seen: Perception) -> None:
    refused = [seen.edit(PlaceModel("box", 0.8 * k, -3.0, 0.0)) for k in range(40)]
    assert refused[0] is None
    told = [r for r in refused if r is not None]
    assert told
    assert all("reject one first" in r for r in told)
    assert sum(o.placed for o in seen.objects()) == 40 - len(told)


# Evidence.


def test_evidence_is_what_the_readings_say_and_looking_changes_nothing(seen: Perception) -> None:
    before = seen.snapshot()
    for o in seen.objects():
        evidence = seen.evidence(number_of(o))
        assert evidence is not None
        assert (evidence.object, evidence.model) == (o.number, o.model)
        assert evidence.supporting > 0.0
        assert evidence.opposing <= 0.0
        if is_full(seen):
            assert evidence.lines == ()
            said = [arc.nats for arc in evidence.arcs]
            assert evidence.supporting == pytest.approx(sum(v for v in said if v > 0.0))
            assert evidence.opposing == pytest.approx(sum(v for v in said if v < 0.0))
            heard = [arc for arc in evidence.arcs if arc.range_m is not None and arc.nats > 0.0]
            for arc in heard:
                assert arc.range_m is not None
                end = (
                    arc.x + arc.range_m * math.cos(arc.direction), arc.y + arc.range_m * math.sin(arc.direction)
                )  # fmt: skip
                assert math.dist(end, (o.x, o.y)) < 0.9, "it ends about where the object is"
            assert len(heard) == pytest.approx(o.support, abs=0.2 * o.support + 3)
            if o.model == "semicircle":
                names = [name for name, _ in evidence.rivals]
                assert set(names) <= {"post", "barrel", "edge", "wall", "corner"}
                assert len(names) >= 3
                assert all(lead < 6.0 for _, lead in evidence.rivals)
        else:
            assert evidence.arcs == ()
            assert evidence.supporting == o.support == sum(line.supports for line in evidence.lines)
            assert evidence.opposing == o.support - len(evidence.lines)
            assert {line.number for line in evidence.lines} <= set(seen.segments().numbers.tolist())
    after = seen.snapshot()
    assert all(before[name].tobytes() == after[name].tobytes() for name in before)


def test_evidence_on_what_is_no_model(begun: Perception) -> None:
    """A track that looks like a post is told as one, and cannot be confirmed as a model."""
    from perception.full.method import FullPerception
    from perception.full.state import ESTABLISHED, KIND, ST

    seen = begun
    method = seen.method
    assert isinstance(method, FullPerception)
    s, p = method.memory, method.settings
    t = int(np.flatnonzero(s.ti[:, ST] == ESTABLISHED)[0])
    s.ti[t, KIND] = p.models
    s.tf[t, 3] = p.radii[p.models]
    number = int(s.names[t, 0])
    evidence = seen.evidence(number)
    assert evidence is not None
    assert evidence.model in {"post", "barrel", "edge", "inside corner"}
    refused = seen.edit(ConfirmObject(number))
    assert refused is not None
    assert "none of the models" in refused


# Memory.


def test_a_snapshot_holds_all_that_was_edited(seen: Perception, firings: list[Firing]) -> None:
    """From a snapshot taken amid edits everything goes on to the bit."""
    objects, listed = seen.objects(), seen.segments().numbers.tolist()
    edits: list[Edit] = [
        DeleteSegments(tuple(listed[:4])), PinSegments(tuple(listed[5:9]), pinned=True),
        PlaceModel("semicircle", 0.5, 0.2, 0.0), PlaceModel("box", -0.5, 0.3, 0.2),
        MoveObject(number_of(objects[0]), objects[0].x + 0.05, objects[0].y, 0.0),
        ConfirmObject(number_of(objects[1])), RejectObject(number_of(objects[2])),
    ]  # fmt: skip
    assert [seen.edit(edit) for edit in edits] == [None] * len(edits)
    method = "full" if is_full(seen) else "paper"
    other = fresh(method)
    other.restore(seen.snapshot())
    assert other.objects() == seen.objects()
    for k, firing in enumerate(again(firings)):
        one, two = ((p.observe(firing), p.refine(), p.refine(), p.objects()) for p in (seen, other))
        assert one == two, k
    mine, theirs = seen.snapshot(), other.snapshot()
    assert mine.keys() == theirs.keys()
    assert [name for name in mine if mine[name].tobytes() != theirs[name].tobytes()] == []


OLDER = {
    "paper": ("numbers", "pinned", "_names", "placements", "_rejections", "_by_hand"),
    "full": ("_pins", "memory.names", "memory.tally", "memory.stamps", "memory.barred"),
}


def test_a_snapshot_of_an_older_program_is_made_good(seen: Perception, firings: list[Firing]) -> None:
    """It lacks what edits need: there are numbers all the same, and all goes on as it would have."""
    method = "full" if is_full(seen) else "paper"
    whole = seen.snapshot()
    old = {n: a for n, a in whole.items() if not any(f".{part}" in n for part in OLDER[method])}
    assert len(old) < len(whole)
    other = fresh(method)
    other.restore(old)
    assert [replace(o, number=None) for o in other.objects()] == [replace(o, number=None) for o in seen.objects()]
    assert None not in {o.number for o in other.objects()}
    assert len(set(other.segments().numbers.tolist())) == other.living == seen.living
    for firing in again(firings):
        hear(seen, firing)
        hear(other, firing)
    assert [replace(o, number=None) for o in other.objects()] == [replace(o, number=None) for o in seen.objects()]
    with pytest.raises(ValueError, match="another method or version"):
        other.restore({n: a for n, a in old.items() if "faults" not in n})


def test_models_are_added_while_it_perceives(seen: Perception, firings: list[Firing]) -> None:
    """Known objects stay what and where they are; the new ones are placed, and compared from then on."""
    method = "full" if is_full(seen) else "paper"
    chosen = SETTINGS[method]
    post = load_model("drum").model_copy(update={"name": "bollard", "arc_radius_m": 0.12})
    crate = load_model("box").model_copy(update={"name": "crate"})
    before = {o.number: o for o in seen.objects()}
    models = (*chosen.models, post, crate)
    seen.recognise(chosen.models)
    assert {o.number: o for o in seen.objects()} == before, "nothing new is nothing"
    seen.recognise(models)
    after: dict[Any, SeenObject] = {o.number: o for o in seen.objects()}
    if is_full(seen):
        assert after == before
    settle(seen)
    assert seen.edit(PlaceModel("bollard", 0.5, 0.2, 0.0)) is None
    assert seen.edit(PlaceModel("crate", -0.5, 0.2, 0.0)) is None
    for firing in again(firings):
        hear(seen, firing)
    found = there(seen)
    assert found.model in {"semicircle"}
    assert {o.model for o in seen.objects() if o.placed} == {"bollard", "crate"}
    other = Perception(chosen.ring, models, chosen.perception)
    other.restore(seen.snapshot())
    assert other.objects() == seen.objects(), "its memory is that of one that knew them from the start"


def test_every_edit_in_turn_on_the_first_things_seen(begun: Perception, firings: list[Firing]) -> None:
    """The full method: what each leaves is there, and from its snapshot, or one of an older program, all goes on."""
    drum = next(o for o in begun.objects() if o.model == "semicircle")
    numbers = begun.segments().numbers.tolist()
    pins, doomed = tuple(numbers[:3]), tuple(numbers[3:6])
    for edit in (
        PinSegments(pins, pinned=True), DeleteSegments(doomed), PlaceModel("semicircle", -0.3, 0.2, 0.0),
        PlaceModel("box", -0.2, -0.3, 0.3), MoveObject(number_of(drum), drum.x + 0.05, drum.y, 0.0),
    ):  # fmt: skip
        assert begun.edit(edit) is None
    drums, boxes = (
        {o.number: o for o in begun.objects() if o.placed and o.model == m} for m in ("semicircle", "box")
    )
    (by_hand,) = drums.keys() - {drum.number}
    (box,) = boxes
    assert by_hand is not None
    assert box is not None
    assert begun.edit(MoveObject(box, -0.1, -0.3, 0.1)) is None
    assert begun.edit(MoveObject(by_hand, 1.5, 0.0, 0.1)) is None
    assert begun.edit(MoveObject(box, 1.0, 0.0, 0.1)) is None
    for firing in firings[EARLY : EARLY + 12]:
        hear(begun, firing)
    assert {by_hand, box, drum.number} <= {o.number for o in begun.objects()}
    for number in (by_hand, box):
        evidence = begun.evidence(number)
        assert evidence is not None
        assert evidence.opposing <= 0.0
    other = fresh("full")
    whole = begun.snapshot()
    other.restore({n: a for n, a in whole.items() if not any(f".{part}" in n for part in OLDER["full"])})
    assert {o.number for o in other.objects()} <= set(range(1, begun.hypotheses + 1))
    other.restore(whole)
    assert other.objects() == begun.objects()
    post = load_model("drum").model_copy(update={"name": "bollard", "arc_radius_m": 0.12})
    begun.recognise((*SETTINGS["full"].models, post))
    assert {o.number for o in begun.objects()} >= {by_hand, box}
    assert begun.edit(RejectObject(box)) is None
    assert begun.edit(RejectObject(by_hand)) is None
    assert {o.number for o in begun.objects()}.isdisjoint({by_hand, box})
    assert set(pins) <= set(begun.segments().numbers.tolist())
    assert set(doomed).isdisjoint(begun.segments().numbers.tolist())
    refused = begun.edit(PlaceModel("chair", 0.0, 0.0, 0.0))
    assert refused is not None
    assert [begun.edit(PlaceModel("box", 0.1 * k, 3.0, 0.0)) is None for k in range(30)].count(False) > 0
    refused = begun.edit(PinSegments((*pins, 10**6), pinned=False))
    assert refused is not None
    assert begun.edit(ClearMap()) is None
    assert begun.things() == ()

"""Edits: refusals, the evidence for objects, snapshots of edited state, and models added while it runs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from config.load import load_model
from drivers.messages import Firing
from perception.detected_object import DetectedObject
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    Edit,
    MoveObject,
    PinSegments,
    PlaceModel,
    RemoveObject,
)
from perception.pipeline import Perception
from tests.perception.edited import (
    EARLY,
    SETTINGS,
    again,
    fresh,
    hear,
    is_bayes,
    number_of,
    settle,
    there,
)

NOWHERE = 999_999
REFUSED: list[tuple[Edit, str]] = [
    (MoveObject(NOWHERE, 0.0, 0.0, 0.0), "no object 999999"),
    (RemoveObject(NOWHERE), "no object 999999"),
    (ConfirmObject(NOWHERE), "no object 999999"),
    (RemoveObject(0), "invalid number 0"),
    (ConfirmObject(-3), "invalid number -3"),
    (MoveObject(2**80, 0.0, 0.0, 0.0), "invalid number"),
    (DeleteSegments((1, 2**80)), "invalid number"),
    (PinSegments((-(2**80),), pinned=True), "invalid number"),
    (PlaceModel("chair", 0.0, 0.0, 0.0), "no model is called chair"),
    (PlaceModel("drum", math.nan, 0.0, 0.0), "invalid pose"),
    (PlaceModel("box", 0.0, math.inf, 0.0), "invalid pose"),
    (PlaceModel("box", 0.0, 1e9, 0.0), "invalid pose"),
    (MoveObject(1, 0.0, 0.0, math.nan), "invalid pose"),
]


@pytest.mark.parametrize(("edit", "reason"), REFUSED, ids=lambda v: v if isinstance(v, str) else v.kind)
def test_an_impossible_edit_is_refused_with_a_reason_and_changes_nothing(
    seen: Perception, edit: Edit, reason: str
) -> None:
    before = seen.snapshot()
    refused = seen.edit(edit)
    assert refused is not None
    assert reason in refused
    assert refused.isprintable()
    after = seen.snapshot()
    assert all(before[name].tobytes() == after[name].tobytes() for name in before)
    assert seen.evidence(NOWHERE) is None


def test_more_placed_objects_than_there_is_room_for_are_archived_or_refused(seen: Perception) -> None:
    refused = [seen.edit(PlaceModel("box", 0.8 * k, -3.0, 0.0)) for k in range(40)]
    assert refused[0] is None
    reasons = [r for r in refused if r is not None]
    assert (seen.counts.archived > 0, len(reasons) > 0) == (is_bayes(seen), not is_bayes(seen))
    assert all("reject one first" in r for r in reasons)
    assert sum(o.placed for o in seen.objects()) == 40 - len(reasons)


# Evidence.


def test_evidence_agrees_with_the_objects_and_changes_nothing(seen: Perception) -> None:
    before = seen.snapshot()
    for o in seen.objects():
        evidence = seen.evidence(number_of(o))
        assert evidence is not None
        assert (evidence.object, evidence.model) == (o.number, o.model)
        assert evidence.supporting > 0.0
        assert evidence.opposing <= 0.0
        if is_bayes(seen):
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
                assert math.dist(end, (o.x, o.y)) < 0.9, "the reading ends near the object"
            assert len(heard) == pytest.approx(o.support, abs=0.2 * o.support + 3)
            if o.model == "drum":
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


@pytest.mark.compiled
def test_evidence_for_an_object_that_is_not_a_model(reached_drums: Perception) -> None:
    """A track that resembles a post is labelled as one and cannot be confirmed as a model."""
    from perception.bayes.bayes_method import BayesPerception
    from perception.bayes.memory.state import ESTABLISHED

    seen = reached_drums
    method = seen.method
    assert isinstance(method, BayesPerception)
    circles, settings = method.memory.circles, method.settings[0]
    t = int(np.flatnonzero(circles["status"] == ESTABLISHED)[0])
    circles["kind"][t] = settings.model_count
    circles["radius"][t] = settings.circles[settings.model_count].radius_m
    number = int(circles["number"][t])
    evidence = seen.evidence(number)
    assert evidence is not None
    assert evidence.model in {"post", "barrel", "edge", "inside corner"}
    refused = seen.edit(ConfirmObject(number))
    assert refused is not None
    assert "matches no model" in refused


# Snapshots and models.


@pytest.mark.compiled
@pytest.mark.boundslong
def test_a_snapshot_holds_the_edited_state(seen: Perception, firings: list[Firing]) -> None:
    """Perception continues from a snapshot taken between edits with identical results."""
    objects, listed = seen.objects(), seen.segments().numbers.tolist()
    edits: list[Edit] = [
        DeleteSegments(tuple(listed[:4])), PinSegments(tuple(listed[5:9]), pinned=True),
        PlaceModel("drum", 0.5, 0.2, 0.0), PlaceModel("box", -0.5, 0.3, 0.2),
        MoveObject(number_of(objects[0]), objects[0].x + 0.05, objects[0].y, 0.0),
        ConfirmObject(number_of(objects[1])), RemoveObject(number_of(objects[2])),
    ]  # fmt: skip
    assert [seen.edit(edit) for edit in edits] == [None] * len(edits)
    method = "bayes" if is_bayes(seen) else "paper"
    other = fresh(method)
    other.restore(seen.snapshot())
    assert other.objects() == seen.objects()
    for k, firing in enumerate(again(firings)):
        one, two = ((p.observe(firing), p.refine(), p.refine(), p.objects()) for p in (seen, other))
        assert one == two, k
    mine, theirs = seen.snapshot(), other.snapshot()
    assert mine.keys() == theirs.keys()
    assert [name for name in mine if mine[name].tobytes() != theirs[name].tobytes()] == []


@pytest.mark.compiled
def test_models_are_added_while_perception_runs(seen: Perception, firings: list[Firing]) -> None:
    """Known objects keep their labels and places; the new models can be placed and are compared from then on."""
    method = "bayes" if is_bayes(seen) else "paper"
    chosen = SETTINGS[method]
    post = load_model("drum").model_copy(update={"name": "bollard", "arc_radius_m": 0.12})
    crate = load_model("box").model_copy(update={"name": "crate"})
    before = {o.number: o for o in seen.objects()}
    models = (*chosen.models, post, crate)
    seen.set_models(chosen.models)
    assert {o.number: o for o in seen.objects()} == before, "the same models change nothing"
    seen.set_models(models)
    after: dict[Any, DetectedObject] = {o.number: o for o in seen.objects()}
    if is_bayes(seen):
        assert after == before
    settle(seen)
    assert seen.edit(PlaceModel("bollard", 0.5, 0.2, 0.0)) is None
    assert seen.edit(PlaceModel("crate", -0.5, 0.2, 0.0)) is None
    for firing in again(firings):
        hear(seen, firing)
    found = there(seen)
    assert found.model in {"drum"}
    assert {o.model for o in seen.objects() if o.placed} == {"bollard", "crate"}
    other = Perception(chosen.ring, models, chosen.perception)
    other.restore(seen.snapshot())
    assert other.objects() == seen.objects(), "its state is that of a perception with all models from the start"


@pytest.mark.compiled
def test_every_edit_in_turn_on_the_first_objects(reached_drums: Perception, firings: list[Firing]) -> None:
    """The Bayesian method: each edit takes effect, and a restored snapshot reports the same objects."""
    drum = next(o for o in reached_drums.objects() if o.model == "drum")
    numbers = reached_drums.segments().numbers.tolist()
    pins, doomed = tuple(numbers[:3]), tuple(numbers[3:6])
    for edit in (
        PinSegments(pins, pinned=True), DeleteSegments(doomed), PlaceModel("drum", -0.3, 0.2, 0.0),
        PlaceModel("box", -0.2, -0.3, 0.3), MoveObject(number_of(drum), drum.x + 0.05, drum.y, 0.0),
    ):  # fmt: skip
        assert reached_drums.edit(edit) is None
    drums, boxes = (
        {o.number: o for o in reached_drums.objects() if o.placed and o.model == m} for m in ("drum", "box")
    )
    (placed_drum,) = drums.keys() - {drum.number}
    (box,) = boxes
    assert placed_drum is not None
    assert box is not None
    assert reached_drums.edit(MoveObject(box, -0.1, -0.3, 0.1)) is None
    assert reached_drums.edit(MoveObject(placed_drum, 1.5, 0.0, 0.1)) is None
    assert reached_drums.edit(MoveObject(box, 1.0, 0.0, 0.1)) is None
    for firing in firings[EARLY : EARLY + 12]:
        hear(reached_drums, firing)
    assert {placed_drum, box, drum.number} <= {o.number for o in reached_drums.objects()}
    for number in (placed_drum, box):
        evidence = reached_drums.evidence(number)
        assert evidence is not None
        assert evidence.opposing <= 0.0
    other = fresh("bayes")
    other.restore(reached_drums.snapshot())
    assert other.objects() == reached_drums.objects()
    post = load_model("drum").model_copy(update={"name": "bollard", "arc_radius_m": 0.12})
    reached_drums.set_models((*SETTINGS["bayes"].models, post))
    assert {o.number for o in reached_drums.objects()} >= {placed_drum, box}
    assert reached_drums.edit(RemoveObject(box)) is None
    assert reached_drums.edit(RemoveObject(placed_drum)) is None
    assert {o.number for o in reached_drums.objects()}.isdisjoint({placed_drum, box})
    assert set(pins) <= set(reached_drums.segments().numbers.tolist())
    assert set(doomed).isdisjoint(reached_drums.segments().numbers.tolist())
    refused = reached_drums.edit(PlaceModel("chair", 0.0, 0.0, 0.0))
    assert refused is not None
    assert all(reached_drums.edit(PlaceModel("box", 0.1 * k, 3.0, 0.0)) is None for k in range(30)), "none is refused"
    assert reached_drums.counts.archived > 0
    refused = reached_drums.edit(PinSegments((*pins, 10**6), pinned=False))
    assert refused is not None
    assert reached_drums.edit(ClearMap()) is None
    assert reached_drums.labelled_objects() == ()

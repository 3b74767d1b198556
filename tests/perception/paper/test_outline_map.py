"""The outline map under a person's hands, against an oracle that keeps segments in a list."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from config.settings import MapConfig
from drivers.messages import Firing, Pose
from perception.edits import PinSegments
from perception.paper.outline_map import OutlineMap
from perception.paper.paper_method import PaperPerception
from tests.perception.halls import settings

CAPACITY = 16
MOUNTS = np.array([[0.0, 0.0, 0.0]])


@dataclass
class Segment:
    number: int
    t: float
    x: float
    pinned: bool = False


def outline_map(age_max_s: float = 10.0) -> OutlineMap:
    return OutlineMap(MapConfig(capacity=CAPACITY, age_max_s=age_max_s), MOUNTS, 0.2)


def row(x: float) -> np.ndarray:
    """A segment that a sensor in the origin looks at squarely, x ahead."""
    return np.array([[x, -0.5, x, 0.5, 0.0]])


def told(outline: OutlineMap) -> list[tuple[int, float, float, int]]:
    listed = outline.listed()
    return sorted(
        (int(n), float(t), float(e[0]), int(p))
        for n, e, t, p in zip(listed.numbers, listed.geometry, listed.times, listed.pinned, strict=True)
    )


def test_any_order_of_adding_ageing_deleting_and_pinning_equals_its_oracle() -> None:
    rng = np.random.default_rng(3)
    for _ in range(60):
        outline, kept, t = outline_map(), list[Segment](), 0.0
        for _ in range(120):
            t += float(rng.choice([0.1, 1.0, 4.0]))
            known = [s.number for s in kept]
            some = {int(n) for n in rng.choice([*known, 10_000], min(4, 1 + len(known)), replace=False)}
            match int(rng.integers(6)):
                case 0 | 1 | 2:
                    for _ in range(int(rng.integers(1, 4))):
                        while len(kept) >= CAPACITY:
                            kept.remove(next(s for s in kept if not s.pinned))
                        outline.add(row(t), t)
                        kept.append(Segment(outline.total, t, t))
                case 3:
                    gone = [s for s in kept if not s.pinned and t - s.t > 10.0]
                    kept = [s for s in kept if s not in gone]
                    outline.age(t)
                case 4:
                    assert outline.delete(some) == some - set(known)
                    kept = [s for s in kept if s.number not in some]
                case _:
                    pinned = bool(rng.integers(2))
                    after = {s.number for s in kept if s.pinned} | (some & set(known))
                    refused = outline.pin(some, pinned=pinned)
                    if pinned and len(after) > CAPACITY // 2:
                        assert refused is None
                        continue
                    assert refused == some - set(known)
                    for s in kept:
                        s.pinned = pinned if s.number in some else s.pinned
            # Room that deleted ones left is used only once it has come to the tail: the map may forget earlier.
            want = sorted((s.number, s.t, s.x, int(s.pinned)) for s in kept)
            have = told(outline)
            assert [w for w in want if w in have] == have
            assert [w for w in want if w[3]] == [h for h in have if h[3]], "what is pinned is there"
            assert outline.pinned == sum(w[3] for w in want)
            kept = [s for s in kept if (s.number, s.t, s.x, int(s.pinned)) in have]


def test_what_is_pinned_does_not_age_and_is_not_pushed_out_and_what_is_let_go_does() -> None:
    outline = outline_map()
    for k in range(4):
        outline.add(row(1.0 + k), 0.1 * k)
    assert outline.pin([2, 3], pinned=True) == set()
    assert outline.age(100.0)
    assert [number for number, *_ in told(outline)] == [2, 3]
    assert not outline.age(200.0), "nothing but pinned ones: none is passed round"
    for k in range(3 * CAPACITY):
        outline.add(row(20.0), 200.0 + 0.01 * k)
    listed = told(outline)
    assert len(listed) == CAPACITY
    assert [number for number, *_ in listed][:2] == [2, 3]
    assert listed[0] == (2, 0.1, 2.0, 1), "it stays what it was"
    assert outline.pin([3], pinned=False) == set()
    outline.age(201.0)
    assert [number for number, *_ in told(outline)][:1] == [2]
    assert 3 not in [number for number, *_ in told(outline)], "let go, it is as old as it is"
    outline.clear()
    assert (told(outline), outline.pinned) == ([], 0)


def test_what_is_pinned_is_not_contradicted() -> None:
    outline = outline_map()
    outline.add(row(1.0), 0.0)
    outline.add(row(2.0), 0.0)
    outline.pin([1], pinned=True)
    firing = Firing(1.0, Pose(0.0, 0.0, 0.0), 0.0, np.array([5.0]))
    assert outline.contradict(firing) == 1
    assert [number for number, *_ in told(outline)] == [1]
    outline.pin([1], pinned=False)
    assert outline.contradict(firing) == 1
    assert told(outline) == []


def test_half_the_map_may_be_pinned() -> None:
    outline = outline_map()
    for k in range(CAPACITY):
        outline.add(row(1.0), 0.1 * k)
    assert outline.pin(range(1, CAPACITY // 2 + 2), pinned=True) is None
    assert outline.pinned == 0
    assert outline.pin(range(1, CAPACITY // 2 + 1), pinned=True) == set()
    assert outline.pin(range(1, CAPACITY // 2 + 1), pinned=True) == set(), "again is no more"
    assert outline.pin([CAPACITY], pinned=True) is None
    assert outline.delete([1]) == set()
    assert outline.pin([CAPACITY], pinned=True) == set()


@pytest.mark.parametrize("lost", [0, 5])
def test_a_recording_without_numbers_gets_them(lost: int) -> None:
    outline = outline_map()
    for k in range(CAPACITY + lost):
        outline.add(row(1.0), 0.1 * k)
    before = outline.numbers.copy()
    outline.restored()
    np.testing.assert_array_equal(outline.numbers, before)
    outline.numbers[:] = 0
    outline.restored()
    np.testing.assert_array_equal(outline.numbers, before)
    assert math.isfinite(outline.times.max())


def test_the_papers_method_says_that_no_more_can_be_pinned() -> None:
    chosen = settings(map=MapConfig(capacity=CAPACITY))
    perception = PaperPerception(chosen.ring, chosen.models, chosen.perception)
    for k in range(CAPACITY):
        perception.outline.add(row(1.0), 0.1 * k)
    refused = perception.edit(PinSegments(tuple(range(1, CAPACITY)), pinned=True))
    assert refused is not None
    assert "half the map" in refused
    assert perception.segments().pinned.sum() == 0

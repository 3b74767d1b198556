"""The outline map under ageing, contradiction and edits, against oracles: a list of segments, and tests/naive.py."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from config.settings import MapConfig
from drivers.messages import Firing, Pose
from perception.edits import PinSegments
from perception.paper.outline_map import OutlineMap, erase_contradicted
from perception.paper.paper_method import PaperPerception
from tests import naive
from tests.perception.halls import settings
from tests.perception.random_outlines import as_segments, random_segments

CAPACITY = 16
MOUNTS = np.array([[0.0, 0.0, 0.0]])


@dataclass
class Segment:
    """The oracle's segment."""

    number: int
    t: float
    x: float
    pinned: bool = False


def outline_map(age_max_s: float = 10.0) -> OutlineMap:
    return OutlineMap(MapConfig(capacity=CAPACITY, age_max_s=age_max_s), MOUNTS, 0.2)


def row(x: float) -> np.ndarray:
    """Return a segment at distance x that a sensor in the origin faces squarely."""
    return np.array([[x, -0.5, x, 0.5, 0.0]])


def listed(outline: OutlineMap) -> list[tuple[int, float, float, int]]:
    """Return number, time, x and pin of each segment, in order of numbers."""
    present = outline.listed()
    return sorted(
        (int(n), float(t), float(e[0]), int(p))
        for n, e, t, p in zip(present.numbers, present.geometry, present.times, present.pinned, strict=True)
    )


def test_any_order_of_adding_ageing_deleting_and_pinning_equals_its_oracle() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
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
            # A deleted segment's slot is reused only when it reaches the tail, so the map may drop others earlier.
            want = sorted((s.number, s.t, s.x, int(s.pinned)) for s in kept)
            have = listed(outline)
            assert [w for w in want if w in have] == have
            assert [w for w in want if w[3]] == [h for h in have if h[3]], "pinned segments are present"
            assert outline.pinned == sum(w[3] for w in want)
            kept = [s for s in kept if (s.number, s.t, s.x, int(s.pinned)) in have]


def test_pinned_segments_neither_age_nor_make_room_and_unpinned_ones_do() -> None:
    outline = outline_map()
    for k in range(4):
        outline.add(row(1.0 + k), 0.1 * k)
    assert outline.pin([2, 3], pinned=True) == set()
    assert outline.age(100.0)
    assert [number for number, *_ in listed(outline)] == [2, 3]
    assert not outline.age(200.0), "with pinned segments only, no slot changes"
    for k in range(3 * CAPACITY):
        outline.add(row(20.0), 200.0 + 0.01 * k)
    rows = listed(outline)
    assert len(rows) == CAPACITY
    assert [number for number, *_ in rows][:2] == [2, 3]
    assert rows[0] == (2, 0.1, 2.0, 1), "a pinned segment keeps its values"
    assert outline.pin([3], pinned=False) == set()
    outline.age(201.0)
    assert [number for number, *_ in listed(outline)][:1] == [2]
    assert 3 not in [number for number, *_ in listed(outline)], "an unpinned segment leaves by its age"
    outline.clear()
    assert (listed(outline), outline.pinned) == ([], 0)


def test_pinned_segments_are_not_contradicted() -> None:
    outline = outline_map()
    outline.add(row(1.0), 0.0)
    outline.add(row(2.0), 0.0)
    outline.pin([1], pinned=True)
    firing = Firing(1.0, Pose(0.0, 0.0, 0.0), 0.0, np.array([5.0]))
    assert outline.remove_contradicted(firing) == 1
    assert [number for number, *_ in listed(outline)] == [1]
    outline.pin([1], pinned=False)
    assert outline.remove_contradicted(firing) == 1
    assert listed(outline) == []


def test_half_the_map_may_be_pinned() -> None:
    outline = outline_map()
    for k in range(CAPACITY):
        outline.add(row(1.0), 0.1 * k)
    assert outline.pin(range(1, CAPACITY // 2 + 2), pinned=True) is None
    assert outline.pinned == 0
    assert outline.pin(range(1, CAPACITY // 2 + 1), pinned=True) == set()
    assert outline.pin(range(1, CAPACITY // 2 + 1), pinned=True) == set(), "pinning again adds nothing"
    assert outline.pin([CAPACITY], pinned=True) is None
    assert outline.delete([1]) == set()
    assert outline.pin([CAPACITY], pinned=True) == set()


def test_contradiction_equals_its_oracle() -> None:
    rng = np.random.default_rng(8)
    erased = 0
    for _ in range(300):
        capacity, start, count = 30, int(rng.integers(30)), int(rng.integers(31))
        rows = random_segments(rng, capacity, 2.0)
        rows[rng.integers(capacity), 2:4] = rows[0, 0:2]
        status = (rng.uniform(size=capacity) < 0.8).astype(np.int64)
        mounts = np.column_stack([rng.uniform(-0.4, 0.4, (8, 2)), rng.uniform(-math.pi, math.pi, 8)])
        x, y, yaw = (float(v) for v in rng.uniform(-2, 2, 3))
        ranges = rng.uniform(0.2, 4.0, 8)
        ranges[0], ranges[1] = math.nan, math.inf
        turn = complex(math.cos(yaw), math.sin(yaw))
        readings = [
            naive.Reading((p := complex(x, y) + complex(m[0], m[1]) * turn).real, p.imag, yaw + m[2], r, 0.0)
            for m, r in zip(mounts, ranges, strict=True)
        ]
        used = {(start + k) % capacity for k in range(count)}
        expected = status.copy()
        for i, segment in enumerate(as_segments(rows)):
            if i in used and any(naive.contradicted(segment, r, 0.4, 0.2) for r in readings):
                expected[i] = 0
        n = erase_contradicted(rows, status, start, count, ranges, mounts, (x, y, yaw), 0.4, 0.2)
        np.testing.assert_array_equal(status, expected)
        erased += n
    assert erased > 75


def test_the_papers_method_refuses_to_pin_more_than_half_of_the_map() -> None:
    chosen = settings(map=MapConfig(capacity=CAPACITY))
    perception = PaperPerception(chosen.ring, chosen.models, chosen.perception)
    for k in range(CAPACITY):
        perception.outline.add(row(1.0), 0.1 * k)
    refused = perception.edit(PinSegments(tuple(range(1, CAPACITY)), pinned=True))
    assert refused is not None
    assert "half of the map" in refused
    assert perception.segments().pinned.sum() == 0

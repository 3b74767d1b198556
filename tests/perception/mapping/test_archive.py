"""The archive against a list that is searched from end to end."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.mapping.archive import Archive
from perception.records import Structured

DTYPE = np.dtype([("number", np.int64), ("x", np.float64), ("y", np.float64), ("what", np.float64, (3,))])


def record(number: int, x: float, y: float) -> Structured:
    return np.array([(number, x, y, (number, x, y))], DTYPE)


def test_records_are_found_by_place_and_number_as_in_a_list() -> None:
    rng = np.random.default_rng(7)
    archive, held, numbers = Archive(DTYPE, {}), dict[int, tuple[float, float]](), iter(range(1, 10_000))
    found = 0
    for _ in range(600):
        if rng.random() < 0.7 or not held:
            number, (x, y) = next(numbers), rng.uniform(-30.0, 30.0, 2).tolist()
            archive.add(record(number, x, y))
            held[number] = (x, y)
        else:
            number = int(rng.choice(list(held)))
            x, y = held.pop(number)
            assert archive.take(number).tobytes() == record(number, x, y).tobytes()
            assert archive.find(number) is None
        (x, y), radius = rng.uniform(-35.0, 35.0, 2).tolist(), float(rng.uniform(0.0, 12.0))
        near = {n: math.hypot(px - x, py - y) for n, (px, py) in held.items()}
        expected = sorted((n for n in near if near[n] <= radius), key=near.__getitem__)
        assert archive.near(x, y, radius) == expected
        found += len(expected)
        assert archive.count == len(held) == len(archive.held())
    assert found > 1000
    for number, (x, y) in held.items():
        row = archive.find(number)
        assert row is not None
        assert row.tobytes() == record(number, x, y).tobytes()
        assert archive.distance(number, 0.0, 0.0) == math.hypot(x, y)


def test_a_grid_built_anew_gives_the_same_and_a_cleared_archive_nothing() -> None:
    archive = Archive(DTYPE, {})
    for number in range(1, 100):
        archive.add(record(number, 0.37 * number, -0.21 * number))
    archive.take(5)
    before = archive.near(3.0, -2.0, 9.0)
    assert before
    archive.drop_caches()
    assert archive.near(3.0, -2.0, 9.0) == before
    archive.clear()
    assert (archive.count, archive.near(3.0, -2.0, 9.0), archive.find(7)) == (0, [], None)


def test_what_is_not_in_the_archive_cannot_be_taken() -> None:
    with pytest.raises(KeyError):
        Archive(DTYPE, {}).take(1)


def test_nothing_that_was_taken_is_left_in_the_rows() -> None:
    archive = Archive(DTYPE, {})
    for number in (1, 2, 3):
        archive.add(record(number, float(number), 0.0))
    for number in (1, 3, 2):
        archive.take(number)
    assert not archive.archived_rows.view(np.uint8).any()

"""Snapshots: every array and number by its dotted name, and refusal of a snapshot of something else."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from config.load import load_settings
from perception.pipeline import Perception
from perception.snapshot import put_back, snapshot_of
from tests.perception.edited import fresh


class Part:
    def __init__(self, value: float) -> None:
        self.value = value


Part.__module__ = "perception.of_a_test"


class Owner:
    SCRATCH = ("_work",)

    def __init__(self, size: int = 3) -> None:
        self.array: NDArray[Any] = np.arange(float(size))
        self.count, self.done, self.part = 5, True, Part(0.5)
        self.settings, self.name, self._work = np.zeros(9), "not kept", np.zeros(4)


def test_arrays_numbers_and_parts_are_copied_and_scratch_is_not() -> None:
    owner = Owner()
    snapshot = snapshot_of(owner)
    assert sorted(snapshot) == ["array", "count", "done", "part.value"]
    owner.array[:] = -1.0
    owner.count, owner.done, owner.part.value = 0, False, 9.0
    kept = owner.array
    put_back(owner, snapshot)
    assert owner.array is kept, "kernels hold views of the arrays"
    assert owner.array.tolist() == [0.0, 1.0, 2.0]
    assert (owner.count, owner.done, owner.part.value) == (5, True, 0.5)
    assert type(owner.done) is bool


def test_scratch_inside_an_array_is_zero_in_a_snapshot_and_left_alone_by_it() -> None:
    owner = Owner()
    owner.array = np.array([(1.0, 2.0)], [("kept", float), ("scratch", float)])
    snapshot = snapshot_of(owner)
    assert snapshot["array"].item() == (1.0, 0.0)
    owner.array[0] = (5.0, 6.0)
    put_back(owner, snapshot)
    assert owner.array.item() == (1.0, 6.0)


def kept_of(records: NDArray[Any]) -> list[bytes]:
    """Return the values of what a snapshot keeps, without the gaps between them."""
    return [records["a"].tobytes(), records["b"]["y"].tobytes(), records["b"]["z"].tobytes()]


@pytest.mark.parametrize("shape", [(), (0,), (1,), (3, 2)])
def test_records_are_copied_whole_there_and_back(shape: tuple[int, ...]) -> None:
    dtype = np.dtype(
        [("a", "i1"), ("scratch", [("x", float, 3)]), ("b", [("y", "i8", (2, 2)), ("z", "?")])], align=True
    )
    owner, rng = Owner(), np.random.default_rng(0)
    records = np.frombuffer(rng.bytes(math.prod(shape) * dtype.itemsize), dtype).reshape(shape).copy()
    for array in (records, records.T):  # one of which is not contiguous
        owner.array, before, scratch = array, kept_of(array), array["scratch"]["x"].tobytes()
        snapshot = snapshot_of(owner)
        assert snapshot["array"].dtype == dtype
        assert not np.shares_memory(snapshot["array"], array)
        assert not snapshot["array"]["scratch"]["x"].any()
        assert kept_of(snapshot["array"]) == before
        array["a"], array["b"] = 0, np.zeros((), dtype["b"])
        put_back(owner, snapshot)
        assert owner.array is array
        assert kept_of(array) == before
        assert array["scratch"]["x"].tobytes() == scratch


def test_records_with_other_places_in_memory_are_another_version() -> None:
    owner, fields = Owner(), [("a", float), ("b", float)]
    owner.array = np.zeros(2, fields)
    snapshot = snapshot_of(owner)
    dtype = np.dtype({"names": ["a", "b"], "formats": [float, float], "offsets": [8, 0]})
    with pytest.raises(ValueError, match="array has other fields"):
        put_back(owner, snapshot | {"array": np.zeros(2, dtype)})


def test_a_snapshot_of_something_else_is_refused() -> None:
    owner, snapshot = Owner(), snapshot_of(Owner())
    with pytest.raises(ValueError, match="another method or version: other"):
        put_back(owner, snapshot | {"other": np.zeros(1)})
    with pytest.raises(ValueError, match=r"of other settings: array is \(4,\), not \(3,\)"):
        put_back(owner, snapshot_of(Owner(4)))
    with pytest.raises(ValueError, match="array has other fields"):
        put_back(owner, snapshot | {"array": np.arange(3)})


def test_the_state_of_one_method_is_not_put_into_the_other() -> None:
    paper, bayes = fresh("paper"), fresh("bayes")
    with pytest.raises(ValueError, match="another method or version"):
        bayes.restore(paper.snapshot())
    ring = load_settings("hallway").ring.model_copy(update={"count": 12})
    chosen = load_settings("hallway", ["perception.method=paper"])
    with pytest.raises(ValueError, match="of other settings"):
        Perception(ring, chosen.models, chosen.perception).restore(paper.snapshot())


class Contradicting(Part):
    def contradiction(self) -> str | None:
        return f"value is {self.value}, which is too much" if self.value > 1.0 else None


Contradicting.__module__ = Part.__module__


def test_a_snapshot_that_contradicts_itself_is_refused() -> None:
    owner, other = Owner(), Owner()
    owner.part, other.part = Contradicting(0.5), Contradicting(0.5)
    put_back(owner, snapshot_of(other))
    other.part.value = 2.0
    with pytest.raises(ValueError, match=r"part\.value is 2\.0, which is too much"):
        put_back(owner, snapshot_of(other))

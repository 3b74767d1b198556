"""Records: dtypes from annotations, and the same memory through numpy and as kernels see it."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from perception.kernel import Floats, Ints, kernel
from perception.records import ITEM_BYTES, Record, Records, array_of, column, records, zeros


class Inner(Record):
    count: int
    value: float


class Outer(Record):
    x: float
    one: Inner
    many: Annotated[Records[Inner], 3]
    row: Annotated[Floats, 2]
    grid: Annotated[Ints, 2, 2]


class Extended(Inner):
    more: float


@kernel
def fill(of: Records[Outer]) -> float:
    total = 0.0
    for i in range(len(of)):
        o = of[i]
        o.x += 1.5
        o.one.count = 7
        for k in range(3):
            o.many[k].value = float(k)
            total += o.many[k].value
        o.row[1] = 2.5
        o.grid[1, 0] = -4
    return total


def test_fields_are_eight_bytes_each_in_the_order_of_their_declaration() -> None:
    assert Inner.DTYPE.names == ("count", "value")
    assert Inner.DTYPE.itemsize == 2 * ITEM_BYTES
    assert Outer.DTYPE.itemsize == (1 + 2 + 6 + 2 + 4) * ITEM_BYTES
    assert Outer.DTYPE["grid"].shape == (2, 2)
    assert Extended.DTYPE.names == ("count", "value", "more")


def test_a_kernel_and_numpy_share_the_memory() -> None:
    array = zeros(Outer, 2)
    view = records(Outer, array)
    array["x"] = 1.0
    assert fill(view) == 2 * 3.0
    assert array["x"].tolist() == [2.5, 2.5]
    assert array["one"]["count"].tolist() == [7, 7]
    assert array["many"]["value"].tolist() == [[0.0, 1.0, 2.0]] * 2
    assert array["row"][:, 1].tolist() == [2.5, 2.5]
    assert array["grid"][0].tolist() == [[0, 0], [-4, 0]]


def test_a_record_is_a_reference() -> None:
    array = zeros(Outer, 3)
    view = records(Outer, array)
    assert len(view) == 3
    view[1].one.value = 3.0
    last = view[2]
    last.x = 9.0
    assert array["one"]["value"].tolist() == [0.0, 3.0, 0.0]
    assert [r.x for r in view] == [0.0, 0.0, 9.0]
    assert len(view[1:]) == 2
    assert view[1:][1].x == 9.0


def test_a_column_is_a_view_and_the_array_is_given_back() -> None:
    array = zeros(Inner, 4)
    view = records(Inner, array)
    column(view, "count")[:] = np.arange(4)
    assert array["count"].tolist() == [0, 1, 2, 3]
    assert np.shares_memory(array_of(view), array)

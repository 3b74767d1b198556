"""A recorded number beyond its bound, and a record that contradicts itself, are refused as they are read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import pytest
from pydantic import TypeAdapter, ValidationError

from config.bounded import CONSISTENT, COORDINATE_MAX, COUNT_MAX, TIME_MAX_S, Coordinate, Count, Number, Seconds, Sign


@dataclass(frozen=True)
class Span:
    begin_s: Seconds
    end_s: Seconds

    def contradiction(self) -> str | None:
        return "it ends before it begins" if self.end_s < self.begin_s else None


@pytest.mark.parametrize(
    ("kind", "most", "wrong"),
    [
        (Seconds, TIME_MAX_S, (math.nan, math.inf, -math.inf, 2e9, -2e9)),
        (Coordinate, COORDINATE_MAX, (math.nan, math.inf, 2e6, -2e6)),
        (Count, COUNT_MAX, (-1, 2**53 + 1, 10**30)),
        (Number, COUNT_MAX, (-(2**53) - 1, 10**30)),
        (Sign, 1, (-2, 2)),
    ],
)
def test_a_number_beyond_its_bound_is_refused(kind: Any, most: float, wrong: tuple[float, ...]) -> None:
    adapter: TypeAdapter[float] = TypeAdapter(kind)
    assert adapter.validate_python(most) == most
    for value in wrong:
        with pytest.raises(ValidationError):
            adapter.validate_python(value)


def test_a_record_that_contradicts_itself_is_refused() -> None:
    adapter: TypeAdapter[Span] = TypeAdapter(Annotated[Span, CONSISTENT])
    good = {"begin_s": 1.0, "end_s": 2.0}
    assert adapter.validate_python(good) == Span(1.0, 2.0)
    with pytest.raises(ValidationError, match="it ends before it begins"):
        adapter.validate_python({**good, "end_s": 0.0})

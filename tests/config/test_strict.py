"""The base class of all settings: immutable, without coercion, unknown keys and non-finite numbers."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pydantic import ValidationError

from config.strict import Point, Strict, TomlList, description


class Example(Strict):
    """A settings model with a field of each kind."""

    size_m: float = 1.0
    """A length, m."""
    count: int = 1
    names: TomlList[str] = ()
    corner_m: Point = (0.0, 0.0)


def test_lists_of_a_file_become_tuples() -> None:
    found = Example.model_validate({"names": ["a", "b"], "corner_m": [1, 2.5]})
    assert (found.names, found.corner_m) == (("a", "b"), (1.0, 2.5))


def test_an_integer_is_a_number_and_nothing_else_is_converted() -> None:
    assert Example.model_validate({"size_m": 2}).size_m == 2.0
    wrong: list[dict[str, Any]] = [
        {"size_m": "2"}, {"size_m": True}, {"count": 1.0}, {"count": "1"}, {"names": "ab"}, {"names": [1]},
        {"corner_m": [1.0]}, {"corner_m": [1.0, 2.0, 3.0]}, {"corner_m": [1e5, 0.0]},
    ]  # fmt: skip
    for table in wrong:
        with pytest.raises(ValidationError):
            Example.model_validate(table)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_non_finite_numbers_are_refused(value: float) -> None:
    with pytest.raises(ValidationError, match="finite"):
        Example(size_m=value)


def test_unknown_keys_and_changes_are_refused() -> None:
    with pytest.raises(ValidationError, match="Extra inputs"):
        Example.model_validate({"sizes_m": 1.0})
    with pytest.raises(ValidationError, match="frozen"):
        Example().size_m = 2.0  # type: ignore[misc]


def test_defaults_are_validated_and_docstrings_describe_fields() -> None:
    class Wrong(Strict):
        """A model whose default is of another type."""

        count: int = 1.5  # type: ignore[assignment]

    with pytest.raises(ValidationError):
        Wrong()
    assert description(Example, "size_m") == "A length, m."

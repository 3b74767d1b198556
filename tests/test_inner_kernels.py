"""Tests that call kernels by themselves are found, also through their helpers; those that do not are not."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from perception.bayes.tracks import refine
from perception.bayes.walls.noise import add_residual
from tests.inner_kernels import is_inner, kernels_of, runs_interpreted_alone
from tests.perception.bayes import test_bayes_method


def helper() -> object:
    return [add_residual for _ in range(3)]


class Helper:
    def helps(self) -> object:
        return refine.quantum if refine else None


def calls() -> object:
    return add_residual


def calls_by_helpers() -> object:
    return helper(), Helper()


def calls_none() -> object:
    return refine.__doc__


@pytest.mark.parametrize(
    ("function", "names"),
    [(calls, {"add_residual"}), (calls_by_helpers, {"add_residual", "quantum"}), (calls_none, set())],
)
def test_the_kernels_of_a_function_are_those_that_it_or_its_helpers_name(
    function: Callable[[], object], names: set[str]
) -> None:
    assert {kernel.__name__ for kernel in kernels_of(function)} == names


def test_what_python_calls_is_loaded_and_a_kernel_of_tests_is_none_of_the_product(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(refine.quantum, "overloads", {(): None})
    monkeypatch.setattr(add_residual, "overloads", {})
    kernels = kernels_of(refine.quantum, add_residual, test_bayes_method.divides)
    assert {kernel.__name__: is_inner(kernel) for kernel in kernels} == {
        "quantum": False, "add_residual": True, "divides": False,
    }  # fmt: skip


def test_only_a_test_of_kernels_that_runs_without_compiling_is_left_to_that(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(add_residual, "overloads", {})
    item = pytest.Function.from_parent(request.node.parent, name="calls", callobj=calls)
    assert not runs_interpreted_alone(item)
    item.add_marker("kernels")
    assert runs_interpreted_alone(item)
    item.add_marker("realtime")
    assert not runs_interpreted_alone(item)

"""What Optuna is asked for, on a stand-in of it; with the real one the optimum is found, each time the same way."""

from __future__ import annotations

import math
import sys
from types import SimpleNamespace
from typing import Any

import pytest

from config.errors import UserError
from config.study import Value, VaryConfig
from runtime.batch.search import OptunaSearch, allows

REAL = VaryConfig(setting="a.real", range=(0.5, 32.0), log=True)
WHOLE = VaryConfig(setting="a.whole", range=(1.0, 9.0))
CHOICE = VaryConfig(setting="a.choice", values=("x", "y"))
VARIED = (REAL, WHOLE, CHOICE)
PRESENT: dict[str, Value] = {"a.real": 2.0, "a.whole": 3, "a.choice": "y"}


class Trial:
    """A trial that suggests the upper end of each range."""

    number = 7

    def suggest_categorical(self, name: str, values: list[Any]) -> Any:
        assert name == "a.choice"
        return values[-1]

    def suggest_int(self, name: str, low: int, high: int, *, log: bool) -> int:
        assert (name, low, log) == ("a.whole", 1, False)
        return high

    def suggest_float(self, name: str, low: float, high: float, *, log: bool) -> float:
        assert (name, low, log) == ("a.real", 0.5, True)
        return high / 3.0


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return what a stand-in of Optuna was called with."""
    calls: list[Any] = []
    study = SimpleNamespace(
        ask=Trial,
        tell=lambda number, cost=None, state=None: calls.append((number, cost, state)),
        enqueue_trial=calls.append,
    )
    stub: Any = SimpleNamespace(
        logging=SimpleNamespace(set_verbosity=lambda _: None, ERROR=40),
        samplers=SimpleNamespace(TPESampler=lambda **options: calls.append(options["seed"])),
        create_study=lambda **_: study,
        trial=SimpleNamespace(TrialState=SimpleNamespace(FAIL="fail")),
    )
    monkeypatch.setitem(sys.modules, "optuna", stub)
    return calls


def test_values_are_asked_for_by_kind_and_rounded(calls: list[Any]) -> None:
    search = OptunaSearch(VARIED, PRESENT, 5)
    assert search.ask() == (7, {"a.real": 10.67, "a.whole": 9, "a.choice": "y"})
    search.tell(7, 0.5)
    search.tell(8, math.inf)
    assert calls == [5, PRESENT, (7, 0.5, None), (8, None, "fail")]


@pytest.mark.usefixtures("calls")
def test_no_value_is_rounded_out_of_its_range(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Trial, "suggest_float", lambda *_, **__: 0.99996)
    whole, real = VaryConfig(setting="a.whole", range=(0.4, 9.7)), VaryConfig(setting="a.real", range=(0.5, 0.99996))
    assert OptunaSearch((whole, real), PRESENT, 5).ask().values == {"a.whole": 9, "a.real": 0.99996}
    with pytest.raises(UserError, match=r"a\.whole: no whole number lies in its range"):
        OptunaSearch((VaryConfig(setting="a.whole", range=(0.4, 0.6)),), PRESENT, 5)


def test_present_values_that_are_not_allowed_are_not_tried(calls: list[Any]) -> None:
    OptunaSearch(VARIED, PRESENT | {"a.real": 50.0}, 5)
    assert calls == [5]


def test_what_a_search_may_try() -> None:
    assert allows(REAL, 0.5)
    assert not allows(REAL, 32.5)
    assert allows(CHOICE, "x")
    assert not allows(CHOICE, "z")


@pytest.mark.soak
def test_the_optimum_is_found_each_time_the_same_way() -> None:
    courses = []
    for _ in range(2):
        search, course = OptunaSearch(VARIED, PRESENT, 1), []
        for _ in range(15):
            for number, values in [search.ask() for _ in range(4)]:
                cost = (
                    math.log(float(values["a.real"]) / 8.0) ** 2
                    + (values["a.choice"] == "y")
                    + 0.1 * float(values["a.whole"])
                )
                search.tell(number, cost)
                course.append((cost, values))
        courses.append(course)
    assert courses[0] == courses[1]
    cost, values = min(courses[0], key=lambda one: one[0])
    assert cost < 0.3
    assert values["a.choice"] == "x"
    assert courses[0][0][1] == PRESENT

"""A changed configuration is applied as a whole, or the last valid one is kept, for any content of the file."""

from __future__ import annotations

import copy
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from config.load import ConfigError, load_settings
from config.places import PlaceConfig
from config.reload import LIVE_SETTINGS, Difference, differences, reload
from config.settings import Settings
from tests.config.test_every_field import EVERY, Setting, holder
from tests.config.toml_text import MODEL, RUN, document

RELOADS, SOAK_RELOADS = 1000, 10_000


def every_path(model: type[BaseModel], at: str = "") -> Iterator[str]:
    for key, field in model.model_fields.items():
        yield f"{at}{key}"
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from every_path(field.annotation, f"{at}{key}.")


def settings_from(folder: Path, table: dict[str, Any]) -> Settings:
    path = folder / "run.toml"
    path.write_text(document(table), encoding="utf-8")
    return load_settings(path)


def test_every_setting_declared_live_exists() -> None:
    assert set(every_path(Settings)) >= LIVE_SETTINGS


def test_settings_that_a_process_is_built_from_are_not_live() -> None:
    fixed = """
        link.port link.baud ring.count ring.sensors ring.range_max_m body.radius_m models cycle.rate_hz log.file world
        perception.method perception.map.capacity perception.bayes.tracks_max perception.clusters.clusters_max
    """
    for path in fixed.split():
        assert not Difference(tuple(path.split(".")), 1, 2).live, path


def test_settings_that_an_operator_changes_while_driving_are_live() -> None:
    live = """
        behaviors.move_ahead.move_ahead_gain behaviors.avoid_static_obstacle.avoid_obstacle_gain
        behaviors.move_to_goal.move_to_goal_gain behaviors.teleoperation.message_age_max_s
        perception.relaxation.gamma perception.clusters.threshold_m perception.map.age_max_s
        cycle.perception_budget_s ring.firing.preset ring.firing.step_period_s perception.segments.baseline_min_m
    """
    for path in live.split():
        assert Difference(tuple(path.split(".")), 1, 2).live, path


def test_lists_of_tables_are_counted() -> None:
    a, b = (PlaceConfig(name=name, x_m=0.0, y_m=0.0) for name in "ab")
    said = [str(Difference(("places", "place"), before, after)) for before, after in (((), (a,)), ((a,), (b,)))]
    assert said == ["places.place: 0 → 1 entries", "places.place: 1 of 1 entries"]


def test_adding_a_model_is_live_and_replacing_one_is_not(tmp_path: Path) -> None:
    before = settings_from(tmp_path, RUN)
    more = {**RUN, "models": [MODEL, {**MODEL, "name": "b"}]}
    outcome = reload(before, lambda: settings_from(tmp_path, more))
    assert (outcome.problems, [m.name for m in outcome.settings.models]) == ((), ["corner", "b"])
    assert [str(d) for d in outcome.changed] == ["models: 1 → 2 entries"]
    for models in ([{**MODEL, "name": "b"}], [{**MODEL, "name": "b"}, MODEL], [{**MODEL, "arc_radius_m": 2.0}]):
        outcome = reload(before, lambda models=models: settings_from(tmp_path, {**RUN, "models": models}))  # type: ignore[misc]
        assert len(outcome.problems) == 1
        assert outcome.problems[0].endswith("needs a restart")
        assert outcome.settings is before
    fewer = reload(settings_from(tmp_path, more), lambda: settings_from(tmp_path, RUN))
    assert len(fewer.problems) == 1


def test_every_live_change_is_named_and_applied(tmp_path: Path) -> None:
    before = settings_from(tmp_path, RUN)
    table = copy.deepcopy(RUN)
    table["behaviors"]["arbiter"] = {"base_velocity_m_s": 0.25}
    table["perception"]["bayes"] = {"report_probability": 0.9}
    table["ring"]["firing"]["preset"] = "quadrants"
    table["perception"]["map"] = {"age_max_s": 60.0}
    outcome = reload(before, lambda: settings_from(tmp_path, table))
    assert outcome.problems == ()
    assert outcome.settings == settings_from(tmp_path, table)
    assert [str(d) for d in outcome.changed] == [
        'ring.firing.preset: "octets" → "quadrants"',
        "perception.bayes.report_probability: 0.95 → 0.9",
        "perception.map.age_max_s: 120.0 → 60.0",
        "behaviors.arbiter.base_velocity_m_s: 0.3 → 0.25",
    ]


@pytest.mark.promise("P11")
@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda t: t["link"].update(port="/dev/ttyS1"), 'link.port: "/dev/ttyS0" → "/dev/ttyS1": needs a restart'),
        (lambda t: t["link"].update(baud=19200), "link.baud: 9600 → 19200: needs a restart"),
        (lambda t: t["ring"].update(count=16), "ring.count: 24 → 16: needs a restart"),
        (lambda t: t["cycle"].update(rate_hz=40.0), "cycle.rate_hz: 20.0 → 40.0: needs a restart"),
        (lambda t: t.pop("world"), "world.drum: "),
        (lambda t: t.update(models=[{**MODEL, "name": "b"}, MODEL]), "models: 1 → 2 entries: needs a restart"),
    ],
)
def test_what_needs_a_restart_says_so_by_name(
    change: Callable[[dict[str, Any]], object], line: str, tmp_path: Path
) -> None:
    before = settings_from(tmp_path, RUN)
    table = copy.deepcopy(RUN)
    change(table)
    table["behaviors"]["arbiter"] = {"base_velocity_m_s": 0.25}
    outcome = reload(before, lambda: settings_from(tmp_path, table))
    assert outcome.settings is before, "a live change together with another one is not applied either"
    assert outcome.changed == ()
    assert any(problem.startswith(line) for problem in outcome.problems), outcome.problems
    assert all(problem.endswith(": needs a restart") for problem in outcome.problems)
    assert not any("base_velocity" in problem for problem in outcome.problems)


def test_no_change_is_no_problem(tmp_path: Path) -> None:
    before = settings_from(tmp_path, RUN)
    outcome = reload(before, lambda: settings_from(tmp_path, RUN))
    assert outcome.settings is before
    assert (outcome.changed, outcome.problems) == ((), ())


VALID: dict[Any, tuple[Any, ...]] = {
    float: (0.0, 0.05, 0.1, 0.3, 0.5, 0.9, 1.0, 5.0, 40.0),
    int: (0, 1, 2, 5, 16, 24, 300, 9600),
    bool: (True, False),
    str: ("/dev/ttyS0", "elsewhere", "corner"),
    "name": ("sum", "largest", "stop", "turn_back", "paper", "bayes", "octets", "quadrants", "info", "cone"),
    "list": ([], [[0], [1]]),
    "table": ({},),
}
INVALID = ("oddly", -1.0, 1e300, True, {"a": 1}, [1.5], 7)
FIELDS = [s for s in EVERY if s.root == "run"]
LIVE_FIELDS = [s for s in FIELDS if Difference(s.location, 0, 1).live]


def mutate(rng: random.Random, table: dict[str, Any]) -> None:
    """Change one to three settings to valid or invalid values."""
    for _ in range(rng.randint(1, 3)):
        setting: Setting = rng.choice(LIVE_FIELDS if rng.random() < 0.7 else FIELDS)
        key = setting.location[-1]
        try:
            under = holder(table, setting.location)
            value = rng.choice(VALID[setting.kind]) if rng.random() < 0.9 else rng.choice(INVALID)
            under[f"{key}q" if rng.random() < 0.03 else key] = copy.deepcopy(value)
        except (AttributeError, IndexError, KeyError, TypeError):
            continue  # an earlier change has replaced the table above it


def rendered(settings: Settings) -> str:
    return settings.model_dump_json()


@pytest.mark.compiled
@pytest.mark.promise("P11")
def test_any_number_of_random_reloads_are_atomic(measured: Callable[[str], None]) -> None:
    check_reloads(RELOADS, 11, measured)


@pytest.mark.soak
@pytest.mark.promise("P11")
def test_ten_thousand_random_reloads_are_atomic(measured: Callable[[str], None]) -> None:
    check_reloads(SOAK_RELOADS, 12, measured)


def check_reloads(count: int, seed: int, measured: Callable[[str], None]) -> None:
    """Assert that each reload is applied as a whole or not at all, and that every live difference is reported."""
    rng = random.Random(seed)
    current = Settings.model_validate(copy.deepcopy(RUN))
    counts = {"applied": 0, "invalid": 0, "needs a restart": 0, "unchanged": 0}
    table = copy.deepcopy(RUN)
    for _ in range(count):
        attempt = copy.deepcopy(table)
        mutate(rng, attempt)
        wanted: list[Settings] = []

        def propose(attempt: dict[str, Any] = attempt, wanted: list[Settings] = wanted) -> Settings:
            try:
                wanted.append(Settings.model_validate(attempt))
            except ValueError as error:
                raise ConfigError(str(error)) from None
            return wanted[0]

        before, text = current, rendered(current)
        outcome = reload(current, propose)
        current = outcome.settings
        if not wanted:
            kind = "invalid"
        elif outcome.problems:
            kind = "needs a restart"
            assert any(not d.live for d in differences(before, wanted[0]))
        elif outcome.changed:
            kind = "applied"
            assert current is wanted[0]
            assert all(d.live for d in outcome.changed)
            assert {d.path for d in outcome.changed} == {d.path for d in differences(before, current)}
            table = attempt
        else:
            kind = "unchanged"
            assert wanted[0] == before
        counts[kind] += 1
        if kind != "applied":
            assert current is before
        assert rendered(before) == text, "the last valid one is untouched"
    assert min(counts.values()) > count // 100, counts
    measured(f"{count:,} random reloads, none half applied: {counts}")

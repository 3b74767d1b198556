"""Rules between the settings of a section, and the description of every setting."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import pytest
from pydantic import BaseModel, ValidationError

from config.settings import AvoidStaticObstacleConfig, MoveToGoalConfig, SegmentsConfig, Settings
from tests.config.toml_text import MODEL, RUN


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SegmentsConfig(baseline_min_m=0.5), "baseline_min_m 0.5 is not below baseline_max_m 0.5"),
        (
            lambda: AvoidStaticObstacleConfig(avoid_obstacle_safety_margin_m=0.6),
            "avoid_obstacle_safety_margin_m is not below avoid_obstacle_sphere_m",
        ),
        (lambda: MoveToGoalConfig(success_radius_m=0.61), "success_radius_m is above controlled_zone_m"),
    ],
)
def test_contradictions_in_a_section_are_refused(make: Callable[[], BaseModel], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        make()


def test_values_on_the_allowed_side_are_accepted() -> None:
    SegmentsConfig(baseline_min_m=0.499)
    AvoidStaticObstacleConfig(avoid_obstacle_safety_margin_m=0.599)
    MoveToGoalConfig(success_radius_m=0.6)


def test_models_have_distinct_names() -> None:
    table: dict[str, Any] = copy.deepcopy(RUN)
    table["models"] = [MODEL, {**MODEL, "name": "other"}]
    assert [model.name for model in Settings.model_validate(table).models] == ["corner", "other"]
    table["models"] = [MODEL, MODEL]
    with pytest.raises(ValidationError, match="two models are named corner"):
        Settings.model_validate(table)


def test_a_run_needs_a_ring_a_body_and_a_model() -> None:
    """All other sections have defaults."""
    required = {name for name, field in Settings.model_fields.items() if field.is_required()}
    assert required == {"ring", "body", "models"}


def sections(model: type[BaseModel], at: str = "") -> list[tuple[str, type[BaseModel]]]:
    found = []
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            found += [(f"{at}{name}", field.annotation), *sections(field.annotation, f"{at}{name}.")]
    return found


def test_every_setting_of_a_section_is_described() -> None:
    """The descriptions are the help of the console."""
    found = sections(Settings)
    assert {"perception.bayes", "behaviors.arbiter", "console"} <= {path for path, _ in found}
    for path, section in found:
        assert section.__doc__, path
        for name, field in section.model_fields.items():
            is_section = isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel)
            assert is_section or field.description, f"{path}.{name}"

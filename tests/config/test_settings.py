"""Rules between the settings of a section, and the description of every setting."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from pydantic import BaseModel, ValidationError

from config.settings import SegmentsConfig, Settings
from config.strict import description
from tests.config.toml_text import MODEL, RUN


def test_segments_need_a_range_of_baselines() -> None:
    with pytest.raises(ValidationError, match=r"baseline_min_m 0\.5 is not below baseline_max_m 0\.5"):
        SegmentsConfig(baseline_min_m=0.5)
    SegmentsConfig(baseline_min_m=0.499)


def test_models_have_distinct_names() -> None:
    table: dict[str, Any] = copy.deepcopy(RUN)
    table["models"] = [MODEL, {**MODEL, "name": "other"}]
    assert [model.name for model in Settings.model_validate(table).models] == ["corner", "other"]
    table["models"] = [MODEL, MODEL]
    with pytest.raises(ValidationError, match="two models are named corner"):
        Settings.model_validate(table)


def test_settings_need_a_ring_and_a_model() -> None:
    """All other sections have defaults; a run refuses a robot without a body by itself."""
    required = {name for name, field in Settings.model_fields.items() if field.is_required()}
    assert required == {"ring", "models"}


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
            assert is_section or description(section, name), f"{path}.{name}"

"""The schemas and conditions of a step: what pydantic refuses is in test_every_field, what a step needs here."""

from __future__ import annotations

import pytest
from pydantic import TypeAdapter, ValidationError

from config.mission_step import Condition, SearchUse, StayOnPathUse
from config.schema_use import SchemaUse

USES: TypeAdapter[SchemaUse] = TypeAdapter(SchemaUse)
CONDITIONS: TypeAdapter[Condition] = TypeAdapter(Condition)


def test_a_table_is_read_by_its_first_key() -> None:
    assert isinstance(USES.validate_python({"name": "search"}), SearchUse)
    assert CONDITIONS.validate_python({"when": "way", "after_m": 2.0}).go == "next"
    for wrong in ({"name": "time", "after_s": 1.0}, {"when": "time"}, {"when": "time", "after_s": 0.0}):
        with pytest.raises(ValidationError):
            CONDITIONS.validate_python(wrong)


def test_a_path_has_length_and_a_search_few_lines() -> None:
    with pytest.raises(ValidationError, match="points_m 1 and 2 are the same place"):
        StayOnPathUse.model_validate({"name": "stay_on_path", "points_m": [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]]})
    with pytest.raises(ValidationError, match="more than 256 lines"):
        SearchUse.model_validate({"name": "search", "width_m": 100.0, "spacing_m": 0.2})

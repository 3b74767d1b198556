"""Messages for invalid values: the value as TOML, its type, the bounds, the nearest known name, and all sources."""

from __future__ import annotations

import datetime
from typing import Any

import pytest
from pydantic import ValidationError

from config.layers import Layers, Source
from config.problems import PROBLEMS_MAX, describe_errors, given_type, shown, unknown_key
from config.settings import Settings
from tests.config.toml_text import RUN


def lines(changes: dict[str, Any]) -> list[str]:
    """Return the messages for a run file under an override."""
    layers = Layers(Source("run.toml"))
    layers.lay(RUN, Source("run.toml"))
    layers.lay(changes, Source("--set"))
    with pytest.raises(ValidationError) as caught:
        Settings.model_validate(layers.tree)
    return describe_errors(caught.value, layers, Settings)


@pytest.mark.parametrize(
    ("value", "text", "kind"),
    [
        (True, "true", "true or false"),
        (3, "3", "an integer"),
        (2.5, "2.5", "a number with a fraction"),
        ('a "b"', '"a \\"b\\""', "a string"),
        ("\x1b", '"\\u001b"', "a string"),
        ([1, "a"], '[1, "a"]', "a list"),
        ({"a": 1}, "{…}", "a table"),
        (datetime.date(2020, 1, 2), "2020-01-02", "a date or time"),
        ("x" * 80, '"' + "x" * 58 + "…", "a string"),
    ],
)
def test_a_value_is_shown_as_toml_and_its_type_named(value: object, text: str, kind: str) -> None:
    assert (shown(value), given_type(value)) == (text, kind)
    assert len(shown(value)) <= 60


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"cycle": {"rate_hz": 500.0}}, "--set: cycle.rate_hz = 500.0: must be at most 200 (and at least 1)"),
        ({"body": {"radius_m": "wide"}}, '--set: body.radius_m = "wide": must be a number, not a string'),
        ({"cycle": {"rate": 1}}, "--set: cycle.rate: unknown key; did you mean rate_hz?"),
        ({"clusters": {}}, "--set: clusters: unknown key; did you mean perception.clusters?"),
        (
            {"log": {"level": "warn"}},
            '--set: log.level = "warn": must be one of debug, info, warning, error; did you',
        ),
        ({"models": []}, "--set: models = []: needs at least one entry, has 0"),
        ({"perception": {"method": "full"}}, '--set: perception.method = "full": was renamed: write "bayes"'),
        (
            {"ring": {"range_min_m": 9.0}},
            "--set over run.toml: ring: range_min_m 9.0 is not below range_max_m 7.7724",
        ),
    ],
    ids=lambda value: str(value)[:40],
)
def test_a_message_names_source_path_value_and_what_is_allowed(changes: dict[str, Any], expected: str) -> None:
    (line,) = lines(changes)
    assert line.startswith(expected)


def test_an_unknown_key_with_no_similar_name_lists_the_known_ones() -> None:
    known = "file, level, cap_mb, webhook, webhook_period_s"
    assert unknown_key(("log", "xyz"), Settings) == f"unknown key; known here: {known}"
    assert unknown_key(("xyz",), Settings, ("robot",)).count("robot") == 1


def test_a_list_with_an_invalid_entry_is_one_problem() -> None:
    assert len(lines({"models": [{**RUN["models"][0], "vertices_m": [[0.0, 0.0], [1.0]]}]})) == 1


def test_more_problems_than_a_page_are_counted() -> None:
    found = lines({f"key{k}": 1 for k in range(PROBLEMS_MAX + 7)})
    assert len(found) == PROBLEMS_MAX + 1
    assert found[-1] == "… and 7 problems more"

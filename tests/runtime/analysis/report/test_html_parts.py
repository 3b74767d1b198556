"""Tests of the parts of a page: everything is escaped, and every setting is listed by its path."""

from __future__ import annotations

import html

from config.load import load_settings
from runtime.analysis.report.html_parts import flattened, note, section, settings_list, table, tile

HOSTILE = "<script>alert('x')</script>&\""


def test_content_is_escaped() -> None:
    for made in (table([HOSTILE], [[HOSTILE]]), note(HOSTILE), tile(HOSTILE, HOSTILE), section(HOSTILE, "x")):
        assert "<script" not in made
        assert html.escape(HOSTILE) in made


def test_a_section_without_content_is_left_out() -> None:
    assert section("Log", "", "") == ""


def test_every_setting_has_its_path_and_value() -> None:
    settings = load_settings("hallway", ["behaviors.arbiter.base_velocity_m_s=0.25"])
    rows = dict(flattened(settings))
    assert rows["behaviors.arbiter.base_velocity_m_s"] == "0.25"
    assert rows["models.0.name"] == "drum"
    assert "link.port" not in rows, "unset values are left out"
    assert settings_list(settings).count("<div>") == len(flattened(settings))

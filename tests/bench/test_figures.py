"""Tests of the page of figures: it is that of its source, and result files enter it."""

from __future__ import annotations

import json
import re
import tomllib
from string import Formatter

import pytest

from bench import recording, timing, waking
from bench.__main__ import OURS
from bench.__main__ import app as bench_app
from bench.figures import COLUMNS, PAGE, RESULT, ROW, SHOWN, SOURCE, by_name, page, taken_in
from config.errors import UserError
from runtime.cli.app import app

LINES_MAX = 200
LINE = '  ["drums", "6", "5", "`x`", "a.json", "{results[ours][found]}; {late[p99.9]:.1f} ms"],\n'


def test_the_page_is_that_of_its_source() -> None:
    """Renew it with `python -m bench figures`."""
    assert PAGE.read_text("utf-8") == page(SOURCE.read_text("utf-8"))
    assert len(PAGE.read_text("utf-8").splitlines()) <= LINES_MAX


def test_each_line_of_the_source_is_a_figure() -> None:
    source = SOURCE.read_text("utf-8")
    rows = [row for group in tomllib.loads(source)["group"] for row in group["rows"]]
    assert [json.loads(line) for line in ROW.findall(source)] == rows
    for row in rows:
        assert len(row) in {COLUMNS, SHOWN + 1}, row
        assert all(row), row
        if len(row) > COLUMNS:
            assert row[RESULT].endswith(".json")
            assert [field for _, field, _, _ in Formatter().parse(row[SHOWN]) if field]


def test_result_files_enter_the_source() -> None:
    results = json.loads('{"results": [{"name": "ours", "found": 6}], "late": {"p99.9": 1.26}}', object_hook=by_name)
    assert '"6; 1.3 ms"' in taken_in(LINE, {"a.json": results})
    assert taken_in(LINE, {"b.json": {}}) == LINE


def test_a_result_file_without_the_figure_is_named() -> None:
    with pytest.raises(UserError, match=r"a\.json does not hold what the figure 'drums' shows"):
        taken_in(LINE, {"a.json": {"results": {}}})


def test_what_the_page_shows_is_what_the_benches_write() -> None:
    known = {
        "timing.json": {timing.ECHO_TO_DRIVE, timing.WAKING, timing.VIRTUAL},
        "recording.json": {recording.LOOP, recording.HOUR_MB},
        "bench.json": {method.name for method in OURS},
        "waking.json": {"timerfd (runtime/timing/wake.py)", "asyncio.sleep", waking.CONTROL},
        "grid.json": {"directed"},
        "localization.json": {"right", "confidently_wrong"},
    }
    rows = [json.loads(line) for line in ROW.findall(SOURCE.read_text("utf-8"))]
    for row in rows:
        if len(row) > COLUMNS:
            names = set(re.findall(r"\[([^\]]+)\]", row[SHOWN]))
            bare = {name.removesuffix(timing.CONTROL) for name in names}
            assert bare & known[row[RESULT]], row


def test_each_command_of_the_page_exists() -> None:
    commands = " ".join(json.loads(line)[3] for line in ROW.findall(SOURCE.read_text("utf-8")))
    for name in re.findall(r"python -m bench ([a-z][\w-]*)", commands):
        assert bench_app[name]
    for name in re.findall(r"echolocate ([a-z][\w-]*)", commands):
        assert app[name]
    named = re.findall(r"((?:tests|bench)/[\w/.]+)", commands)
    named += [f"{name.replace('.', '/')}.py" for name in re.findall(r"python -m (bench\.\w+)", commands)]
    assert len(named) > 5
    assert [path for path in named if not (SOURCE.parents[1] / path).exists()] == []

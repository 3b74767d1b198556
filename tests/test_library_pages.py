"""The pages and the notebook on the library: their examples run in an empty folder, and print what they show."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
import re
import sys
import types
from pathlib import Path

import pytest

from runtime.analysis.export.csv_tables import NAMES, tables
from tests.recorded import hall, record
from tests.runtime.analysis.synthetic_timeline import synthetic_timeline

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / "docs").glob("library*.md"))
OTHERS = "mine.csv"
"""A log of another program, which no test has."""


def examples(page: Path) -> list[str]:
    """Return the examples of a page that need no file of the reader's, with shorter drives and one hall."""
    blocks = re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    short = [text.replace("range(50)", "range(1)").replace("seconds_max=20.0", "seconds_max=6.0") for text in blocks]
    return [text for text in short if OTHERS not in text]


@pytest.mark.compiled
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_examples_run_in_an_empty_folder(page: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Where there is no pandas, a table is its columns."""
    monkeypatch.chdir(tmp_path)
    if importlib.util.find_spec("pandas") is None:
        monkeypatch.setitem(sys.modules, "pandas", types.SimpleNamespace(DataFrame=dict))
    if "drive.mcap" in page.read_text("utf-8") and page.stem == "library-recordings":
        record(hall(), tmp_path / "drive.mcap", seconds=2.0)
    found = examples(page)
    assert found
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        for text in found:
            exec(text, {})
    assert printed.getvalue()


def test_the_page_on_recordings_names_every_table_and_only_columns_that_are_there() -> None:
    text = (ROOT / "docs" / "library-recordings.md").read_text("utf-8")
    rows = {row[0]: row[1] for row in re.findall(r"^\| `(\w+)` \|.*\| (.*) \|$", text, re.MULTILINE)}
    assert rows.keys() == {*NAMES}
    for name, table in tables(synthetic_timeline()).items():
        assert {*re.findall(r"`(\w+)`", rows[name])} <= {*table}, name


@pytest.mark.compiled
def test_the_notebook_prints_what_it_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    for cell in json.loads((ROOT / "docs" / "library.ipynb").read_text("utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                exec("".join(cell["source"]), names)
            shown = ("".join(output["text"]) for output in cell["outputs"])
            assert printed.getvalue() == "".join(shown)


@pytest.mark.compiled
def test_the_notebook_runs_outside_the_clone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    cells = json.loads((ROOT / "docs" / "library.ipynb").read_text("utf-8"))["cells"]
    first, *_, last = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    names: dict[str, object] = {}
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(first, names)
        exec(last, names)
    assert printed.getvalue().startswith("left out")

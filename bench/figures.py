"""The page of figures: what was asked and measured, from `bench/figures.toml` and the result files of the benches."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any, Final

from config.errors import FAILED, UserError

SOURCE: Final = Path(__file__).with_name("figures.toml")
PAGE: Final = Path(__file__).parents[1] / "docs" / "figures.md"
ROW: Final = re.compile(r"^  (\[.*\]),$", re.MULTILINE)
COLUMNS: Final = 4
"""Figure, asked, measured, command; a row that a bench measures goes on with its result file and how it is shown."""
MEASURED: Final = 2
RESULT: Final = 4
SHOWN: Final = 5
HEADER: Final = """# Figures

What was asked, what was measured, and the command that measures it again. *Missed* stands where a goal was not
reached. Measured on two cores of a virtual machine (x86-64, CPython 3.11); `git blame bench/figures.toml` says when.
This page is made from that file by `python -m bench figures`; `make bench` first takes in what it measures. Lengths
are in feet where the paper has feet. What was tried and left out: [notes on the estimator](estimator-notes.md).
"""


def page(source: str) -> str:
    """Return the page, in Markdown.

    Parameters
    ----------
    source : str
        As `figures.toml`.
    """
    parts = [HEADER]
    for group in tomllib.loads(source)["group"]:
        rows = ["| " + " | ".join(row[:COLUMNS]) + " |" for row in group["rows"]]
        head = ["| what | asked | measured | command |", "|---|---|---|---|"]
        parts.append("\n".join([f"## {group['title']}", "", group["text"], "", *head, *rows, ""]))
    return "\n".join(parts)


def taken_in(source: str, results: dict[str, Any]) -> str:
    """Return the source with the measured values of the result files that there are.

    Parameters
    ----------
    source : str
        As `figures.toml`.
    results : dict
        What each result file holds, by its name.

    Raises
    ------
    UserError
        A result file lacks a figure.
    """

    def renewed(line: re.Match[str]) -> str:
        row: list[str] = json.loads(line[1])
        if len(row) <= RESULT or row[RESULT] not in results:
            return line[0]
        try:
            row[MEASURED] = row[SHOWN].format(**results[row[RESULT]])
        except (LookupError, TypeError, ValueError) as error:
            raise UserError(
                f"{row[RESULT]} does not hold what the figure {row[0]!r} shows ({error!r}): measure it again, or "
                f"correct its line in {SOURCE.name}",
                FAILED,
            ) from error
        return f"  {json.dumps(row, ensure_ascii=False)},"

    return ROW.sub(renewed, source)


def by_name(part: dict[str, Any]) -> dict[str, Any]:
    """Return a part of a result file, in which lists of what has a name are found by that name."""
    return {
        key: {one["name"]: one for one in value} if is_named(value) else value for key, value in part.items()
    }  # fmt: skip


def is_named(value: object) -> bool:
    """Return whether a value is a list of objects that each have a name."""
    return isinstance(value, list) and bool(value) and all(isinstance(one, dict) and "name" in one for one in value)


def renew(results: Path | None) -> int:
    """Write the page, after taking in the result files of a folder; return the number of values that changed.

    Parameters
    ----------
    results : Path, optional
        Folder of the result files.

    Raises
    ------
    UserError
        A result file lacks a figure.
    """
    before = SOURCE.read_text("utf-8")
    paths = () if results is None else results.glob("*.json")
    found = {path.name: json.loads(path.read_bytes(), object_hook=by_name) for path in paths}
    after = taken_in(before, found)
    SOURCE.write_text(after, "utf-8")
    PAGE.write_text(page(after), "utf-8")
    return sum(a != b for a, b in zip(before.splitlines(), after.splitlines(), strict=True))

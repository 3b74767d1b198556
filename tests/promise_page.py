"""The page of promises: its rows, read and renewed, and its text.

Rows of tests that did not run stay as they were, each with its own date.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from tests.promise_limits import LIMITS
from tests.promises import PROMISES, PromiseTest, Results

NO_PROMISE = "–"
"""Stands for an ID in rows of tests without one."""


class Row(NamedTuple):
    """Row of the page."""

    promise: str
    test: str
    measured: str
    day: str

    def __str__(self) -> str:
        return f"| {self.promise} | `{self.test}` | {self.measured} | {self.day} |"


_ROW = re.compile(r"\| (?P<promise>P\d+|–) \| `(?P<test>[^`]+)` \| (?P<measured>.*) \| (?P<day>[-\d]+) \|")


def _sort_key(row: tuple[str, ...]) -> tuple[int, str]:
    """Return the sort key of a row that starts with ID and test, so that the page does not depend on the run."""
    return [*PROMISES, NO_PROMISE].index(row[0]), row[1]


def rows_of(tests: Iterable[PromiseTest], *, soak: bool) -> list[tuple[str, str]]:
    """Return the pairs (ID, test) of the page, sorted by ID and then by test."""
    listed = [test for test in tests if test.soak == soak]
    return sorted(((one, test.test) for test in listed for one in test.ids or (NO_PROMISE,)), key=_sort_key)


def rows_in(page: str) -> list[Row]:
    """Return the rows of a written page."""
    return [Row(**found.groupdict()) for found in map(_ROW.fullmatch, page.splitlines()) if found is not None]


def listed_in(page: str) -> list[tuple[str, str]]:
    """Return the pairs (ID, test) of a written page."""
    return [(row.promise, row.test) for row in rows_in(page)]


def merged(results: Results, before: Iterable[Row], *, soak: bool, day: str) -> list[Row]:
    """Return the rows of the page: new rows of the tests that ran, and the earlier rows of the others.

    Parameters
    ----------
    results
        Results of this run.
    before
        Rows of the page before this run.
    soak
        Whether the page lists soak tests or ordinary ones.
    day
        Date of this run, YYYY-MM-DD.

    Raises
    ------
    ValueError
        A test of a promise failed; or, in a run of the whole suite, did not run.
    """
    due = rows_of(results.tests, soak=soak)
    tests = {test for _, test in due}
    if missing := sorted(tests & results.failed | (tests - results.measured.keys() if results.whole else set())):
        raise ValueError(f"did not pass: {', '.join(missing)}")
    ran = {
        (one, test): Row(one, test, "<br>".join(results.measured[test]) or "passed", day)
        for one, test in due
        if test in results.measured
    }
    if results.whole:
        return list(ran.values())
    known = {(row.promise, row.test): row for row in before if row.promise in {*PROMISES, NO_PROMISE}} | ran
    return sorted(known.values(), key=_sort_key)


def render(rows: Sequence[Row], *, soak: bool) -> str:
    """Return the page as Markdown: the promises, then the tests with their measurements and dates."""
    command, other = ("make soak", "make promises") if soak else ("make promises", "make soak")
    lines = [
        "# Promises and measurements",
        "",
        f"Written by `{command}` from the tests that ran. The {'short' if soak else 'long'} forms: `{other}`.",
        f"`pytest{' -m soak' if soak else ''} TEST --promises=PAGE` renews the rows of single tests.",
        "",
    ]
    kept = dict.fromkeys(row.promise for row in rows if row.promise in PROMISES)
    lines += [f"- **{one}: {PROMISES[one].text}.** {PROMISES[one].figure}." for one in kept]
    if not soak:
        lines += ["", "## What nothing can contradict", ""]
        lines += ["A lie is found where it contradicts the robot's own motion, clock or map. These do not:", ""]
        lines += [f"- {limit}" for limit in LIMITS]
        lines += ["", "## Measurements"]
    lines += ["", "| promise | test | measured | on |", "|---|---|---|---|"]
    return "\n".join([*lines, *map(str, rows)]) + "\n"

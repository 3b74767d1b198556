"""Tests of the traceability of promises, `tests/promises.py`, and of their page."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests import promises
from tests.promise_page import listed_in, merged, render, rows_in, rows_of
from tests.promises import (
    PAGE,
    PROMISES,
    RESULTS,
    ROOT,
    SOAK_PAGE,
    PromiseTest,
    Results,
    unverified,
)

pytestmark = pytest.mark.promise("P16")

EVERY = Results(
    (
        PromiseTest("a.py::test_all", tuple(PROMISES), soak=False),
        PromiseTest("a.py::test_long", ("P4",), soak=True),
        PromiseTest("b.py::test_free", (), soak=True),
    ),
    whole=True,
    measured={"a.py::test_all": ["12 of 12", "0.3 s"], "a.py::test_long": [], "b.py::test_free": ["7 to 8"]},
)


def run_suite(folder: Path, test: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a test suite of one file."""
    (folder / "test_it.py").write_text(f"import pytest\n\n{test}\n")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "tests.conftest", "-p", "no:cacheprovider", *arguments]
    return subprocess.run(command, cwd=ROOT, text=True, capture_output=True, timeout=600.0, check=False)


class StubItem:
    """A collected test with a promise marker."""

    nodeid = "test_it.py::test_it"

    def __init__(self, *ids: str) -> None:
        self.mark = pytest.mark.promise(*ids).mark

    def iter_markers(self, name: str) -> Iterator[pytest.Mark]:
        yield from [self.mark] if name == "promise" else []

    def get_closest_marker(self, name: str) -> pytest.Mark | None:
        return self.mark if name == "promise" else None


@pytest.mark.parametrize("ids", [("P99",), ("P4", "p5"), ()], ids=str)
def test_unknown_id_stops_every_run_at_collection(ids: tuple[str, ...]) -> None:
    items: Any = [StubItem("P4"), StubItem(*ids)]
    assert promises.tests_of(items[:1]) == (PromiseTest("test_it.py::test_it", ("P4",), soak=False),)
    with pytest.raises(pytest.UsageError, match=r"test_it: @pytest\.mark\.promise names .*add it to tests/promises"):
        promises.tests_of(items)


def test_id_without_test_stops_only_a_run_of_the_whole_suite(tmp_path: Path) -> None:
    """A run of one file is not stopped: see the next test."""
    some = ", ".join(f'"{one}"' for one in PROMISES if one != "P4")
    test = f"@pytest.mark.promise({some})\ndef test_it() -> None:\n    pass"
    whole = run_suite(tmp_path, test, "-o", f"testpaths={tmp_path}")
    assert whole.returncode == pytest.ExitCode.USAGE_ERROR, whole.stdout
    assert "no test verifies P4:" in whole.stderr


def test_run_writes_measurements_unless_a_test_fails(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    for number, passes in ((7, True), (8, False)):
        test = (
            '@pytest.mark.parametrize("n", [1, 7])\n@pytest.mark.promise("P4", "P6")\n'
            f'def test_it(n, measured) -> None:\n    measured(f"found {{n}}")\n    assert n in (1, {number})\n'
        )
        done = run_suite(tmp_path, test, str(tmp_path / "test_it.py"), "--promises", str(page))
        assert done.returncode == (0 if passes else pytest.ExitCode.USAGE_ERROR), done.stdout + done.stderr
        text = page.read_text("utf-8")
        assert [one for one, _ in listed_in(text)] == ["P4", "P6"]
        assert text.count("found 1<br>found 7 |") == 2
        assert PROMISES["P4"].figure in text
        assert PROMISES["P5"].figure not in text
    assert "was not changed: did not pass: " in done.stdout
    assert "assert 7 in (1, 8)" in done.stdout, "the failure is reported as usual"


def test_promise_with_only_a_soak_test_is_unverified() -> None:
    assert unverified(EVERY.tests) == []
    long = [PromiseTest(c.test, c.ids, soak=True) for c in EVERY.tests]
    assert unverified(long) == list(PROMISES)


def written(results: Results, before: str = "", *, soak: bool = False, day: str = "2026-01-02") -> str:
    return render(merged(results, rows_in(before), soak=soak, day=day), soak=soak)


def test_page_round_trip() -> None:
    for soak in (False, True):
        assert listed_in(written(EVERY, soak=soak)) == rows_of(EVERY.tests, soak=soak)
    assert "12 of 12<br>0.3 s" in written(EVERY)
    assert "| P4 | `a.py::test_long` | passed | 2026-01-02 |" in written(EVERY, soak=True)
    assert "| – | `b.py::test_free` | 7 to 8 | 2026-01-02 |" in written(EVERY, soak=True)
    with pytest.raises(ValueError, match=r"did not pass: a\.py::test_all"):
        written(replace(EVERY, measured={"a.py::test_long": []}))


def test_run_of_some_tests_renews_only_their_rows() -> None:
    whole = written(EVERY, soak=True, day="2026-01-02")
    part = Results((PromiseTest("a.py::test_long", ("P4",), soak=True),), measured={"a.py::test_long": ["9 of 9"]})
    page = written(part, whole, soak=True, day="2026-01-03")
    changed = "| P4 | `a.py::test_long` | passed | 2026-01-02 |", "| P4 | `a.py::test_long` | 9 of 9 | 2026-01-03 |"
    assert page == whole.replace(*changed)
    assert written(part, page, soak=True, day="2026-01-03") == page
    new = Results((PromiseTest("a.py::test_a", ("P2",), soak=True),), measured={"a.py::test_a": []})
    assert [row[0] for row in listed_in(written(new, page, soak=True))] == ["P2", "P4", "–"]
    with pytest.raises(ValueError, match=r"did not pass: a\.py::test_long"):
        written(replace(part, failed={"a.py::test_long"}), page, soak=True)
    none = Results((PromiseTest("a.py::test_long", ("P4",), soak=True),))
    assert written(none, page, soak=True) == page, "deselected and skipped tests change nothing"


@pytest.mark.parametrize("page", [PAGE, SOAK_PAGE], ids=lambda page: page.name)
def test_committed_pages_list_the_tests_of_the_suite(
    request: pytest.FixtureRequest, measured: Callable[[str], None], page: Path
) -> None:
    results = request.config.stash[RESULTS]
    soak = page == SOAK_PAGE
    if not results.whole:
        pytest.skip("only a run of the whole suite collects all tests")
    if soak and not page.exists():
        pytest.skip("no page of soak tests has been committed")
    expected = rows_of(results.tests, soak=soak)
    if request.config.getoption("promises") is None:  # otherwise it is being written
        listed = listed_in(page.read_text("utf-8"))
        # Long forms may be run one by one, so any may be missing; but every listed one must exist.
        assert set(listed) <= set(expected) if soak else listed == expected, (
            f"run `make {'soak' if soak else 'promises'}`"
        )
    if not soak:
        measured(f"{len(PROMISES)} promises, {len({test for _, test in expected})} tests")

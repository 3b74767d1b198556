"""What is promised is tested, and what is tested is told: the machinery of `tests/promises.py` itself."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from tests.promises import (
    LEDGER,
    PAGE,
    PROMISES,
    ROOT,
    SOAK_PAGE,
    Carrier,
    Ledger,
    broken,
    listed_in,
    merged,
    render,
    rows_in,
    rows_of,
)

pytestmark = pytest.mark.promise("P16")

EVERY = Ledger(
    (
        Carrier("a.py::test_all", tuple(PROMISES), soak=False),
        Carrier("a.py::test_long", ("P4",), soak=True),
        Carrier("b.py::test_free", (), soak=True),
    ),
    whole=True,
    results={"a.py::test_all": ["12 of 12", "0.3 s"], "a.py::test_long": [], "b.py::test_free": ["7 to 8"]},
)


def run_suite(folder: Path, test: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a suite that consists of one file."""
    (folder / "test_it.py").write_text(f"import pytest\n\n{test}\n")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "tests.conftest", "-p", "no:cacheprovider", *arguments]
    return subprocess.run(command, cwd=ROOT, text=True, capture_output=True, timeout=120.0, check=False)


@pytest.mark.parametrize("ids", ['"P99"', '"P4", "p5"', ""])
def test_an_unknown_id_ends_every_run_before_it_begins(tmp_path: Path, ids: str) -> None:
    test = f"@pytest.mark.promise({ids})\ndef test_it() -> None:\n    pass"
    done = run_suite(tmp_path, test, str(tmp_path / "test_it.py"))
    assert done.returncode == pytest.ExitCode.USAGE_ERROR, done.stdout
    assert "test_it.py::test_it: @pytest.mark.promise names" in done.stderr
    assert "add it to tests/promises.py" in done.stderr


def test_an_id_without_a_test_ends_a_run_of_the_whole_suite_and_no_other(tmp_path: Path) -> None:
    some = ", ".join(f'"{one}"' for one in PROMISES if one != "P4")
    test = f"@pytest.mark.promise({some})\ndef test_it() -> None:\n    pass"
    whole = run_suite(tmp_path, test, "-o", f"testpaths={tmp_path}")
    assert whole.returncode == pytest.ExitCode.USAGE_ERROR, whole.stdout
    assert "no test carries P4:" in whole.stderr
    part = run_suite(tmp_path, test, str(tmp_path / "test_it.py"))
    assert part.returncode == 0, part.stdout + part.stderr


def test_a_run_writes_what_its_tests_measured_and_nothing_where_one_fails(tmp_path: Path) -> None:
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
    assert "is left as it is: did not pass: " in done.stdout
    assert "assert 7 in (1, 8)" in done.stdout, "and what failed is told as ever"


def test_a_promise_that_only_a_soak_test_carries_is_not_kept() -> None:
    assert broken(EVERY.carriers) == []
    long = [Carrier(c.test, c.ids, soak=True) for c in EVERY.carriers]
    assert broken(long) == list(PROMISES)


def written(ledger: Ledger, before: str = "", *, soak: bool = False, day: str = "2026-01-02") -> str:
    return render(merged(ledger, rows_in(before), soak=soak, day=day), soak=soak)


def test_the_page_reads_back_as_what_it_was_written_from() -> None:
    for soak in (False, True):
        assert listed_in(written(EVERY, soak=soak)) == rows_of(EVERY.carriers, soak=soak)
    assert "12 of 12<br>0.3 s" in written(EVERY)
    assert "| P4 | `a.py::test_long` | passed | 2026-01-02 |" in written(EVERY, soak=True)
    assert "| – | `b.py::test_free` | 7 to 8 | 2026-01-02 |" in written(EVERY, soak=True)
    with pytest.raises(ValueError, match=r"did not pass: a\.py::test_all"):
        written(replace(EVERY, results={"a.py::test_long": []}))


def test_a_run_of_some_tests_renews_their_rows_and_leaves_the_others() -> None:
    whole = written(EVERY, soak=True, day="2026-01-02")
    part = Ledger((Carrier("a.py::test_long", ("P4",), soak=True),), results={"a.py::test_long": ["9 of 9"]})
    page = written(part, whole, soak=True, day="2026-01-03")
    changed = "| P4 | `a.py::test_long` | passed | 2026-01-02 |", "| P4 | `a.py::test_long` | 9 of 9 | 2026-01-03 |"
    assert page == whole.replace(*changed)
    assert written(part, page, soak=True, day="2026-01-03") == page
    new = Ledger((Carrier("a.py::test_a", ("P2",), soak=True),), results={"a.py::test_a": []})
    assert [row[0] for row in listed_in(written(new, page, soak=True))] == ["P2", "P4", "–"]
    with pytest.raises(ValueError, match=r"did not pass: a\.py::test_long"):
        written(replace(part, failed={"a.py::test_long"}), page, soak=True)
    none = Ledger((Carrier("a.py::test_long", ("P4",), soak=True),))
    assert written(none, page, soak=True) == page, "what was deselected or skipped says nothing"


@pytest.mark.parametrize("page", [PAGE, SOAK_PAGE], ids=lambda page: page.name)
def test_the_committed_pages_list_what_the_suite_has(
    request: pytest.FixtureRequest, measured: Callable[[str], None], page: Path
) -> None:
    ledger = request.config.stash[LEDGER]
    soak = page == SOAK_PAGE
    if not ledger.whole:
        pytest.skip("only a run of the whole suite knows all tests")
    if soak and not page.exists():
        pytest.skip("no soak has been committed")
    has = rows_of(ledger.carriers, soak=soak)
    if request.config.getoption("promises") is None:  # else it is being written
        listed = listed_in(page.read_text("utf-8"))
        # Of the long forms any may be run by itself; but none is listed that there is not.
        assert set(listed) <= set(has) if soak else listed == has, f"run `make {'soak' if soak else 'promises'}`"
    if not soak:
        measured(f"{len(PROMISES)} promises, {len({test for _, test in has})} tests")

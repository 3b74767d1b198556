"""What is promised is tested, and what is tested is told: the machinery of `tests/promises.py` itself."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
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
    render,
    rows_of,
)

pytestmark = pytest.mark.promise("P16")

EVERY = Ledger(
    (Carrier("a.py::test_all", tuple(PROMISES), soak=False), Carrier("a.py::test_long", ("P4",), soak=True)),
    whole=True,
    results={"a.py::test_all": ["12 of 12", "0.3 s"], "a.py::test_long": []},
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
    for number, text in ((7, "found 7"), (8, None)):
        test = (
            '@pytest.mark.parametrize("n", [1, 7])\n@pytest.mark.promise("P4", "P6")\n'
            f'def test_it(n, measured) -> None:\n    measured(f"found {{n}}")\n    assert n in (1, {number})\n'
        )
        done = run_suite(tmp_path, test, str(tmp_path / "test_it.py"), "--promises", str(page))
        assert done.returncode == (0 if text else pytest.ExitCode.USAGE_ERROR), done.stdout + done.stderr
        written = page.read_text("utf-8")
        assert [one for one, _ in listed_in(written)] == ["P4", "P6"]
        assert written.count("found 1<br>found 7 |") == 2
        assert PROMISES["P4"].figure in written
        assert PROMISES["P5"].figure not in written
    assert "is left as it is: did not pass: " in done.stdout
    assert "assert 7 in (1, 8)" in done.stdout, "and what failed is told as ever"


def test_a_promise_that_only_a_soak_test_carries_is_not_kept() -> None:
    assert broken(EVERY.carriers) == []
    long = [Carrier(c.test, c.ids, soak=True) for c in EVERY.carriers]
    assert broken(long) == list(PROMISES)


def test_the_page_reads_back_as_what_it_was_written_from() -> None:
    for soak in (False, True):
        assert listed_in(render(EVERY, soak=soak)) == rows_of(EVERY.carriers, soak=soak)
    assert "12 of 12<br>0.3 s" in render(EVERY, soak=False)
    assert "| P4 | `a.py::test_long` | passed |" in render(EVERY, soak=True)
    with pytest.raises(ValueError, match=r"did not pass: a\.py::test_all"):
        render(Ledger(EVERY.carriers, results={"a.py::test_long": []}), soak=False)


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
        assert listed_in(page.read_text("utf-8")) == has, f"run `make {'soak' if soak else 'promises'}`"
    if not soak:
        measured(f"{len(PROMISES)} promises, {len({test for _, test in has})} tests")

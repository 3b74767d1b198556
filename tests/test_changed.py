"""Which tests `make check` runs for a change."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.changed import BOUNDS, DRAWN, EVERY, QUICK, RELATED, ROOT, bounds_changed, find_tests
from tests.mutation.quick_check import CHANGES, Change


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name, text in {
        "tests/a/test_b.py": "from tests.a.helper import value\n",
        "tests/a/test_c.py": "from tests.a import helper\n",
        "tests/a/test_d.py": "",
        "tests/a/helper.py": "value = 1\n",
        "tests/a/conftest.py": "",
        "tests/x/test_y.py": "from tests.a.helper import value\n",
    }.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("changed", "tests"),
    [
        (["a/b.py"], ["tests/a/test_b.py"]),
        (["a/no_test_of_its_own.py", "a/b.toml", "README.md"], []),
        (["tests/a/test_d.py", "a/b.py"], ["tests/a/test_b.py", "tests/a/test_d.py"]),
        (["tests/a/test_removed.py"], []),
        (["tests/a/helper.py"], ["tests/a/test_b.py", "tests/a/test_c.py", "tests/x/test_y.py"]),
        (["tests/a/conftest.py"], ["tests/a/test_b.py", "tests/a/test_c.py", "tests/a/test_d.py"]),
    ],
)
def test_a_change_maps_to_tests_by_path(root: Path, changed: list[str], tests: list[str]) -> None:
    assert find_tests(changed, root) == tests


def test_bounds_of_a_state_are_known_by_their_declaration(root: Path) -> None:
    (root / "perception").mkdir()
    (root / "perception" / "records.py").write_text("from perception.bounds import Count\n")
    (root / "perception" / "other.py").write_text("")
    assert bounds_changed(["a/b.py", "perception/records.py"], root)
    assert not bounds_changed(["perception/other.py", "perception/removed.py", "perception/bounds.toml"], root)


def test_the_quick_tests_exist() -> None:
    related = (name for names in RELATED.values() for name in names)
    assert [name for name in (*QUICK, *EVERY, *related, DRAWN, BOUNDS) if not (ROOT / name).exists()] == []


def test_a_change_of_what_lists_hold_runs_the_tests_of_the_lists() -> None:
    found = find_tests(["config/mission_step.py"])
    assert {"tests/behaviors/test_schema_registry.py", "tests/test_docs.py"} <= {*found}


@pytest.mark.parametrize(
    ("changed", "test"),
    [
        ("runtime/console/frames/state_message.py", "tests/runtime/console/frames/test_frame_encoder.py"),
        ("runtime/console/page/parameters.js", "tests/browser/test_drive.py"),
        ("runtime/console/page/draw_grid.js", DRAWN),
        ("runtime/cycle/inputs.py", "tests/runtime/recording/test_schema.py"),
        ("behaviors/wander.py", "tests/behaviors/test_schema_registry.py"),
        ("docs/tutorial.md", "tests/runtime/cli/test_tutorial.py"),
        ("docs/build-a-ring.md", "tests/drivers/firmware/test_bundle.py"),
        ("docs/extending.md", "tests/test_extending_page.py"),
    ],
)
def test_a_change_runs_what_it_breaks_elsewhere(changed: str, test: str) -> None:
    assert test in find_tests([changed])


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.kind)
def test_the_typical_changes_can_be_made(change: Change) -> None:
    """`python -m tests.mutation.quick_check` makes them, and runs the quick check on each."""
    kind, path, old, new = change
    assert (ROOT / path).read_text("utf-8").replace(old, new, 1) != (ROOT / path).read_text("utf-8"), kind
    assert find_tests([path]) != []

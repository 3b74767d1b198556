"""The documents name only what exists: paths in backticks, and in the walk along an echo each function passed."""

from __future__ import annotations

import ast
import contextlib
import functools
import importlib
import re
from pathlib import Path

import pytest

from config.files import list_shipped
from config.reference import markdown
from config.schema_use import SHIPPED_USES
from drivers.registry import SHIPPED
from tests import command_page, page_types, safety_page
from tests.drivers.contract.families import FAMILIES

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")])
ROOMS = ("behaviors/", "bench/", "config/", "docs/", "drivers/", "perception/", "runtime/", "tests/")
ROW = re.compile(r"^\| `(?P<module>[\w/]+\.py)` \| (?P<functions>.+?) \|", re.MULTILINE)


def paths_in(text: str) -> set[str]:
    """Return every path of the project that `text` names in backticks or links to."""
    named = re.findall(r"`([\w./-]+)`", text) + re.findall(r"\]\(([\w./-]+)", text)
    return {path for path in named if path.startswith(ROOMS)}


def definitions(path: Path) -> set[str]:
    """Return the functions, classes and methods that a module defines, methods as `Class.method`."""
    found = set()
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            methods = (part for part in node.body if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef))
            found |= {f"{node.name}.{method.name}" for method in methods}
    return found


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_path_exists(document: Path) -> None:
    missing = {path for path in paths_in(document.read_text("utf-8")) if not (ROOT / path).exists()}
    assert not missing


def test_the_walk_names_functions_that_exist() -> None:
    rows = ROW.findall((ROOT / "docs" / "following-an-echo.md").read_text("utf-8"))
    assert len(rows) >= 20
    for module, cell in rows:
        named = re.findall(r"`([A-Za-z_][\w.]*)`", cell)
        assert named, module
        unknown = set(named) - definitions(ROOT / module)
        assert not unknown, f"{module} does not define {sorted(unknown)}"


def defined(name: str) -> object:
    """Return what a dotted name stands for: a module, or something in one; a field of a record is its annotation.

    Raises
    ------
    AttributeError
        Nothing has that name.
    """
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        with contextlib.suppress(ModuleNotFoundError):
            module: object = importlib.import_module(".".join(parts[:k]))
            return functools.reduce(member, parts[k:], module)
    raise AttributeError(name)


def member(of: object, name: str) -> object:
    """Return an attribute, or the annotation of a field that only has one."""
    annotated = (vars(base).get("__annotations__", {}) for base in getattr(of, "__mro__", ()))
    fields = {field: kind for of_base in annotated for field, kind in of_base.items()}
    return fields[name] if name in fields and not hasattr(of, name) else getattr(of, name)


@pytest.mark.parametrize("page", ["estimator.md", "estimator-notes.md"])
def test_the_estimator_names_what_exists(page: str) -> None:
    named = re.findall(r"`((?:perception|runtime)\.[\w.]+)`", (ROOT / "docs" / page).read_text("utf-8"))
    assert len(named) >= (100 if page == "estimator.md" else 1)
    missing = []
    for name in sorted(set(named)):
        try:
            defined(name)
        except AttributeError:
            missing.append(name)
    assert not missing, f"{page} names what is not there (moved or renamed?): {missing}"


def test_the_estimator_gives_the_values_of_the_program() -> None:
    text = (ROOT / "docs" / "estimator.md").read_text("utf-8")
    rows = re.findall(r"\| (-?[\d.]+) \| `(perception\.[\w.]+)` \|$", text, re.MULTILINE)
    assert len(rows) >= 10
    stale = {name: defined(name) for value, name in rows if defined(name) != pytest.approx(float(value), rel=1e-3)}
    assert not stale


def test_the_site_lists_every_document() -> None:
    listed = re.findall(r": ([\w-]+\.md)$", (ROOT / "mkdocs.yml").read_text("utf-8"), re.MULTILINE)
    assert sorted(listed) == sorted(path.name for path in (ROOT / "docs").glob("*.md"))


def test_the_page_of_settings_is_that_of_the_models() -> None:
    """Renew it with `echolocate settings --out docs/settings.md --force`."""
    assert (ROOT / "docs" / "settings.md").read_text("utf-8") == markdown()


def test_the_page_of_commands_is_that_of_the_program() -> None:
    """Renew it with `python -m tests.command_page`."""
    assert command_page.words(command_page.PAGE.read_text("utf-8")) == command_page.words(command_page.page())


def test_what_is_listed_by_hand_is_all_that_is_shipped() -> None:
    """Robots in the README, schemas on the page of missions, families in the contract of their drivers."""
    readme, missions = ((ROOT / name).read_text("utf-8") for name in ("README.md", "docs/missions.md"))
    assert [name for name in list_shipped("robots") if f"`{name}`" not in readme] == []
    assert [name for name in SHIPPED_USES if f"`{name}`" not in missions] == []
    assert SHIPPED.keys() - FAMILIES.keys() == set()


def test_the_page_on_safety_is_that_of_the_program() -> None:
    """Renew it with `python -m tests.safety_page`."""
    assert safety_page.PAGE.read_text("utf-8") == safety_page.page()


@pytest.mark.parametrize(
    ("document", "most"), [("README.md", 150), ("docs/figures.md", 200), ("docs/estimator.md", 300)]
)
def test_what_is_read_first_stays_short(document: str, most: int) -> None:
    assert len((ROOT / document).read_text("utf-8").splitlines()) <= most


def test_the_types_of_the_page_are_those_of_the_models() -> None:
    """Renew them with `python -m tests.page_types`."""
    assert page_types.FILE.read_text("utf-8") == page_types.page_types()

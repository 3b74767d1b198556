"""Run the tests of what changed since the last commit: `python -m tests.changed`, part of `make check`.

The test of a/b.py is tests/a/test_b.py, so a path is enough to find it. What a change breaks elsewhere is mostly
found by the tests of the modules that import it, and by those that hold a list or a page for all (`RELATED`). A
helper of tests stands for the test files that import it, a script of the page for the tests that touch the same
elements. Where nothing is found, a few quick files run instead. `python -m tests.mutation.quick_check` shows what all
this misses.
"""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
QUICK = (
    "tests/config/test_load.py",
    "tests/config/test_reload.py",
    "tests/behaviors/test_arbiter.py",
    "tests/drivers/denning/test_codec.py",
    "tests/drivers/denning/test_driver.py",
    "tests/perception/paper",
    "tests/runtime/cycle/test_modes.py",
    "tests/test_docs.py",
    "tests/test_source_rules.py",
)
"""Files that take seconds and cover every package, for a change that maps to no test."""
RELATED = {
    "config/": (
        "tests/config/test_every_field.py",
        "tests/config/test_reference.py",
        "tests/config/test_shipped.py",
        "tests/test_docs.py",
    ),
    "config/mission": ("tests/behaviors/test_schema_registry.py", "tests/config/test_schema_use.py"),
    "config/schema_use": ("tests/behaviors/test_schema_registry.py", "tests/runtime/cycle/test_missions_random.py"),
    "behaviors/schema": ("tests/config/test_schema_use.py", "tests/behaviors/missions"),
    "drivers/": ("tests/drivers/test_registry.py",),
    "drivers/contract/": ("tests/drivers/contract",),
    "drivers/capabilities": ("tests/test_docs.py", "tests/drivers/contract/test_plugin.py"),
    "drivers/registry": ("tests/test_docs.py",),
    "runtime/cli/": ("tests/runtime/cli/test_app.py", "tests/test_docs.py"),
    "docs/": ("tests/test_docs.py", "tests/drivers/contract/test_example.py"),
    "docs/figures.md": ("tests/bench/test_figures.py",),
    "bench/figures": ("tests/bench/test_figures.py",),
    "docs/library": ("tests/test_library_pages.py",),
    "config/models/": ("tests/test_library_pages.py",),
    "runtime/cycle/": ("tests/runtime/recording/test_schema.py", "tests/test_extending_page.py"),
    "runtime/cycle/step": ("tests/runtime/cycle/test_modes.py",),
    "runtime/console/": ("tests/test_docs.py",),
    "runtime/console/frames/": ("tests/runtime/console/frames", "tests/test_extending_page.py"),
    "runtime/console/page/": ("tests/runtime/console/http/test_static_files.py",),
    "README.md": ("tests/test_docs.py",),
    "CONTRIBUTING.md": ("tests/test_docs.py",),
    "mkdocs.yml": ("tests/test_docs.py",),
    "pyproject.toml": ("tests/test_packaging.py",),
}
"""Tests that hold a list, a page or a rule for all files whose path begins so, by that beginning."""
EVERY = ("tests/test_source_rules.py",)
"""Tests of rules that any file of Python can break; they take seconds."""
KERNELS = ("perception/", "behaviors/valley/", "drivers/emulator/")
"""After a change of these, tests run without the compiler: compiling the kernels again takes a minute."""


TIMEOUT_S = "60"
"""Of `tests.hil.machine`: a person waits, and several tests may hang because of one change."""
PRODUCT = ("behaviors", "config", "drivers", "perception", "runtime")
USERS_MAX = 5
"""Tests of so many modules that import a changed one run as well, the nearest by their path first."""
PAGE = "runtime/console/page/"
DRAWN = "tests/browser/test_display.py"
"""For a script that names no element: it draws."""
PAGE_TESTS_MAX = 2
"""Files of tests in a browser that run for a script of the page; each takes half a minute."""


BOUNDS = "tests/runtime/recording/test_snapshot_bounds.py"
"""Whether every state of whole drives keeps its bounds. It takes half a minute compiled, and hours if not."""
COMPILED_S = 60
"""Processor time after which that is given up, as kernels would have to be compiled for it."""


def changed_files() -> list[str]:
    """Return the files that differ from the last commit, new ones included, relative to the root."""
    commands = (["git", "diff", "--name-only", "HEAD"], ["git", "ls-files", "--others", "--exclude-standard"])
    listed = [subprocess.run(c, cwd=ROOT, check=True, capture_output=True, text=True).stdout for c in commands]
    return sorted({line for text in listed for line in text.splitlines()})


def find_tests(files: Iterable[str], root: Path = ROOT) -> list[str]:
    """Return the test files of changed files, relative to the root.

    Parameters
    ----------
    files : iterable of str
        Paths relative to the root; files that were removed may be among them.
    root : Path
        Folder of the code base.
    """
    found: set[str] = set()
    for name in files:
        path = Path(name)
        found |= {test for begin, tests in RELATED.items() if name.startswith(begin) for test in tests}
        if name.startswith(PAGE) and path.suffix == ".js":
            found |= touching(path, root)
        if path.suffix != ".py":
            found |= naming(path, root)
            continue
        found |= {*EVERY}
        if path.parts[0] != "tests":
            found |= {test_of(path), *users_tests(path, root)}
        elif path.name.startswith("test_"):
            found.add(name)
        else:
            found |= importing(path, root)
    return sorted(test for test in found if (root / test).exists())


def test_of(module: Path) -> str:
    """Return the test file of a module of the product."""
    return f"tests/{module.parent.as_posix()}/test_{module.name}"


def users_tests(module: Path, root: Path) -> list[str]:
    """Return the tests of the modules that import a changed one, at most `USERS_MAX`, the nearest by path first."""
    package, name = re.escape(".".join(module.parent.parts)), re.escape(module.stem)
    imports = re.compile(rf"from {package}(\.{name} import| import \(?[^\n]*\b{name}\b)")
    users = [
        user.relative_to(root)
        for folder in PRODUCT
        for user in (root / folder).rglob("*.py")
        if imports.search(user.read_text("utf-8"))
    ]
    users.sort(key=lambda user: (module.parent not in user.parents, module.parts[0] != user.parts[0], user))
    tests = (test_of(user) for user in users)
    return [test for test in tests if (root / test).exists()][:USERS_MAX]


def touching(script: Path, root: Path) -> set[str]:
    """Return the tests in a browser that name most of the elements and requests that a script of the page names."""
    if not (root / script).exists():
        return set()
    text = (root / script).read_text("utf-8")
    names = {*re.findall(r'(?:byId\(|type: )"([\w-]+)"', text)}
    hits = {}
    for test in sorted((root / "tests/browser").glob("test_*.py")):
        said = test.read_text("utf-8")
        own = test.stem == f"test_{script.stem}"
        hits[test.relative_to(root).as_posix()] = (own, sum(name in said for name in names))
    best = sorted(hits, key=lambda test: hits[test], reverse=True)[:PAGE_TESTS_MAX]
    return {test for test in best if any(hits[test])} or {DRAWN}


def bounds_changed(files: Iterable[str], root: Path = ROOT) -> bool:
    """Return whether a changed file declares bounds of what perception remembers."""
    sources = (root / name for name in files if name.startswith("perception/") and name.endswith(".py"))
    return any(one.exists() and "bounds" in one.read_text("utf-8") for one in sources)


def naming(file: Path, root: Path) -> set[str]:
    """Return the test files that name a document or another file that is no module, if they are few."""
    said = re.compile(rf"""["'/]{re.escape(file.name)}["']""")
    tests = (test for test in (root / "tests").rglob("test_*.py") if "browser" not in test.parts)
    found = {test.relative_to(root).as_posix() for test in tests if said.search(test.read_text("utf-8"))}
    return found if len(found) <= USERS_MAX else set()


def importing(helper: Path, root: Path) -> set[str]:
    """Return the test files that import a helper of tests; for a conftest.py, those of its folder."""
    if helper.name == "conftest.py":
        return {test.relative_to(root).as_posix() for test in (root / helper.parent).glob("test_*.py")}
    package, name = ".".join(helper.parent.parts), helper.stem
    lines = (f"from {package} import {name}", f"from {package}.{name} import")
    return {
        test.relative_to(root).as_posix()
        for test in (root / "tests").rglob("test_*.py")
        if any(line in test.read_text("utf-8") for line in lines)
    }


def main() -> int:
    """Run the tests; return pytest's exit code."""
    files = changed_files()
    tests = find_tests(files)
    marked = "not soak and not realtime"
    environment = {"ECHOLOCATE_TEST_TIMEOUT_S": TIMEOUT_S, **os.environ}
    if any(name.startswith(KERNELS) and name.endswith(".py") for name in files):
        environment["NUMBA_DISABLE_JIT"] = "1"
        marked += " and not compiled"
    sys.stdout.write(f"{len(files)} changed files, {len(tests) or 'no'} test files by their paths\n")
    sys.stdout.flush()
    command = [sys.executable, "-m", "pytest", "-q", "-m", marked, *(tests or QUICK)]
    code = subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode
    nothing_collected = 5
    if tests and code == nothing_collected:
        code = 0
    return code or (check_bounds() if bounds_changed(files) else 0)


def check_bounds() -> int:
    """Check the bounds on whole compiled drives; return pytest's exit code, 0 where that takes too long."""
    command = [sys.executable, "-m", "pytest", "-q", "-m", "not soak and not boundscheck", BOUNDS]
    limit = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (COMPILED_S, limit[1]))  # of the child, which gets it
    code = subprocess.run(command, cwd=ROOT, check=False).returncode
    if code != -signal.SIGXCPU:
        return code
    sys.stdout.write(f"left out: {BOUNDS}, for which kernels have to be compiled\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())

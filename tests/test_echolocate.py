"""The public surface under one name, and what happens where a file hides a package of ours."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import echolocate
from runtime.batch.cluster import WORKER_COMMAND
from runtime.support.child_process import child_environment, start_child
from tests.hil.machine import TIMEOUT_S

ROOT = Path(__file__).resolve().parents[1]
HOSTILE = ("config", "dask", "drivers", "numpy", "orjson", "perception", "runtime", "structlog")


def imported_names(path: Path) -> set[str]:
    """Return the names that a source imports from our packages, at any depth."""
    imports = (node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.ImportFrom))
    ours = (node for node in imports if (node.module or "").partition(".")[0] in echolocate.PACKAGES)
    return {alias.name for node in ours for alias in node.names} - {"main"}


def call(*words: str, path: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder with a `PYTHONPATH`, without the current folder in its path."""
    env = {**os.environ, "PYTHONPATH": path}
    command = [sys.executable, "-P", *words]
    return subprocess.run(
        command, capture_output=True, text=True, cwd=folder, env=env, check=False, timeout=TIMEOUT_S
    )


@pytest.fixture
def hostile(tmp_path: Path) -> Path:
    """Return a folder with modules of our names and of libraries, which leave a trace when one is imported."""
    for name in HOSTILE:
        (tmp_path / f"{name}.py").write_text("from pathlib import Path\nPath(__file__).with_suffix('.ran').touch()\n")
    return tmp_path


def test_every_public_name_can_be_imported_and_has_its_types() -> None:
    assert {name for name in echolocate.__all__ if getattr(echolocate, name, None) is None} == set()
    assert imported_names(ROOT / "echolocate.py") == set(echolocate.__all__)
    assert imported_names(ROOT / "echolocate-stubs" / "__init__.pyi") == set(echolocate.__all__)
    assert dir(echolocate) == sorted(echolocate.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'recognizer'"):
        _ = echolocate.recognizer


def test_importing_it_imports_nothing_else() -> None:
    done = call(
        "-c", "import sys, echolocate; print({'numba', 'config'} & set(sys.modules))", path=str(ROOT), folder=ROOT
    )
    assert done.stdout == "set()\n"


@pytest.mark.parametrize("package", echolocate.PACKAGES)
def test_a_hidden_package_is_one_clear_line(package: str, tmp_path: Path) -> None:
    (tmp_path / f"{package}.py").touch()
    path = os.pathsep.join((str(tmp_path), str(ROOT)))
    done = call("-c", "import echolocate; echolocate.main()", path=path, folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"echolocate: {tmp_path / package}.py hides echolocate's own package '{package}': ")
    assert done.stderr.count("\n") == 1
    done = call("-c", "from echolocate import Recogniser", path=path, folder=tmp_path)
    assert f"ImportError: {tmp_path / package}.py hides" in done.stderr


def test_a_folder_that_hides_a_package_is_named(tmp_path: Path) -> None:
    (tmp_path / "runtime").mkdir()
    (tmp_path / "runtime" / "__init__.py").touch()
    done = call("-P", "-m", "echolocate", path=os.pathsep.join((str(tmp_path), str(ROOT))), folder=tmp_path)
    assert f"{tmp_path / 'runtime' / '__init__.py'} hides" in done.stderr


async def test_a_child_process_imports_nothing_of_the_current_folder(
    hostile: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(hostile)
    for is_low in (False, True):
        process = await start_child("runtime.cli", ["check", "hallway"], pipes=True, low_priority=is_low)
        output, errors = await process.communicate()
        assert (process.returncode, errors) == (0, b"")
        assert b"good" in output
    assert list(hostile.glob("*.ran")) == []


def test_a_local_worker_imports_nothing_of_the_current_folder(hostile: Path) -> None:
    pytest.importorskip("dask", reason="pip install 'echolocate[sweep]'")
    command, env = [*WORKER_COMMAND, "--help"], child_environment()
    subprocess.run(command, capture_output=True, cwd=hostile, env=env, check=True, timeout=TIMEOUT_S)
    assert list(hostile.glob("*.ran")) == []


def test_no_process_is_started_with_the_current_folder_in_its_path() -> None:
    sources = [path for package in echolocate.PACKAGES for path in (ROOT / package).rglob("*.py")]
    assert [path for path in sources if 'sys.executable, "-m"' in path.read_text("utf-8")] == [
        ROOT / "runtime" / "cli" / "commands" / "service.py"  # of a clone, started in its folder
    ]

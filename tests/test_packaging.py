"""What is installed: every file that the program reads at run time, and a wheel that works outside the clone."""

from __future__ import annotations

import fnmatch
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("behaviors", "config", "drivers", "perception", "runtime")


def needed() -> set[str]:
    """Return the files of the packages, as the clone has them."""
    listed = subprocess.run(
        ["git", "-C", str(ROOT), "ls-files", *PACKAGES], check=True, capture_output=True, text=True
    )
    return set(listed.stdout.split())


def test_every_data_file_is_installed() -> None:
    """By the patterns of the project file, which are those that setuptools applies."""
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["setuptools"]["package-data"]
    wanted = [f"{package.replace('.', '/')}/{pattern}" for package, of in patterns.items() for pattern in of]
    data = {path for path in needed() if not path.endswith(".py")}
    assert len(data) > 40
    assert {path for path in data if not any(fnmatch.fnmatch(path, pattern) for pattern in wanted)} == set()


@pytest.mark.soak
def test_wheel_and_source_distribution_work_outside_the_clone(tmp_path: Path) -> None:
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def run(*command: str | Path) -> str:
        done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path, env=env)
        return done.stdout

    run(sys.executable, "-m", "pip", "install", "-q", "--target", tmp_path / "tools", "build")
    env["PYTHONPATH"] = str(tmp_path / "tools")
    run(sys.executable, "-m", "build", "--outdir", tmp_path / "dist", ROOT)
    del env["PYTHONPATH"]
    (wheel,), (source,) = (tmp_path / "dist").glob("*.whl"), (tmp_path / "dist").glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as packed:
        assert needed() <= set(packed.namelist())
    with tarfile.open(source) as packed_source:
        assert needed() <= {name.partition("/")[2] for name in packed_source.getnames()}
    venv.create(tmp_path / "venv", with_pip=True)
    installed = tmp_path / "venv" / "bin"
    run(installed / "pip", "install", "-q", wheel)
    assert "(commit " in run(installed / "echolocate", "--version"), "the clone is not there, its commit is"
    run(installed / "echolocate", "check", "hallway")
    env["XDG_CACHE_HOME"], env["XDG_STATE_HOME"] = str(tmp_path / "cache"), str(tmp_path / "state")
    run(installed / "echolocate", "experiment", "hallway", "--json", "table.json")
    assert (tmp_path / "table.json").stat().st_size > 100


@pytest.mark.parametrize(
    ("there", "taken"),
    [(("python3.12", "python3.13"), "python3.12"), (("python3.13",), "python3.13"), ((), "python3.11")],
)
def test_make_takes_the_first_python_that_is_there(tmp_path: Path, there: tuple[str, ...], taken: str) -> None:
    make = shutil.which("make")
    assert make is not None
    for name in there:
        (tmp_path / name).write_text("#!/bin/sh\n")
        (tmp_path / name).chmod(0o755)
    said = subprocess.run(
        [make, "--eval", "which: ; $(info taken $(PYTHON))", "which"], cwd=ROOT, capture_output=True, text=True,
        env={"PATH": str(tmp_path)}, check=False,
    )  # fmt: skip
    assert f"taken {taken}\n" in said.stdout, said.stderr

"""A package as if it were installed: its modules and its entry points in a folder on the path."""

from __future__ import annotations

import configparser
import importlib
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path

import pytest


def install(
    monkeypatch: pytest.MonkeyPatch, folder: Path, files: Mapping[str, str], entries: Mapping[str, Mapping[str, str]]
) -> None:
    """Write a package's files and entry points, by their groups, and make them known to this process."""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    roots = {name.partition("/")[0].removesuffix(".py") for name in files}
    for module in [name for name in sys.modules if name.partition(".")[0] in roots]:
        monkeypatch.delitem(sys.modules, module)
    if entries:
        _write_entries(folder, entries)
    monkeypatch.syspath_prepend(str(folder))
    importlib.invalidate_caches()


def install_editable(folder: Path) -> None:
    """Do what an editable installation of a package's folder does: its entry points beside its modules."""
    project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    info = folder / f"{folder.name}-0.1.dist-info"  # which names a package
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    points = configparser.ConfigParser()
    points.read_dict(project["entry-points"])
    with (info / "entry_points.txt").open("w") as file:
        points.write(file)


def _write_entries(folder: Path, entries: Mapping[str, Mapping[str, str]]) -> None:
    (folder / "plug-1.0.dist-info").mkdir()
    (folder / "plug-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: plug\nVersion: 1.0\n")
    groups = (f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in names.items()) for group, names in entries.items())
    (folder / "plug-1.0.dist-info" / "entry_points.txt").write_text("".join(groups))

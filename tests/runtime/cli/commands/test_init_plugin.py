"""A package of one's own from an empty folder: installed, it keeps the contract and drives; a schema drives, too."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from config.errors import DONE, WRONG_CALL, UserError
from config.load import load_any, load_robot
from runtime.cli.commands.init_plugin import write_plugin
from tests.installed import install, install_editable

ROOT = Path(__file__).resolve().parents[4]


@pytest.mark.parametrize(
    ("part", "said"),
    [("motion", " passed, "), pytest.param("", "41 passed, 7 skipped", marks=pytest.mark.soak)],
)
def test_a_robot_is_a_package_that_keeps_the_contract_in_less_than_a_hundred_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert write_plugin("skippy", "robot") == DONE
    files = [file for file in (tmp_path / "skippy").rglob("*") if file.is_file()]
    assert len(files) == 3
    assert sum(len(file.read_text().splitlines()) for file in files) < 100
    install_editable(tmp_path / "skippy")
    options = (
        "-q -p no:cacheprovider --disable-plugin-autoload -p echolocate_pytest --echolocate-family skippy:FAMILY"
    )
    command = [sys.executable, "-m", "pytest", *options.split(), "-k", part]
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path / 'skippy'}:{ROOT}"}
    empty = tmp_path / "empty"
    empty.mkdir()
    done = subprocess.run(command, cwd=empty, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert said in done.stdout


def test_a_robot_and_a_schema_are_known_by_their_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, kind in (("skippy", "robot"), ("orbit", "schema")):
        assert write_plugin(name, kind) == DONE
        install_editable(tmp_path / name)
        install(monkeypatch, tmp_path / name, {}, {})
    assert load_robot("skippy").robot.driver == "skippy"
    mission = tmp_path / "m.toml"
    mission.write_text('name = "out"\n[[step]]\nname = "out"\nschemas = [{name = "orbit", way_m = 0.5}]\n')
    assert load_any(mission).model_dump()["step"][0]["schemas"] == ({"name": "orbit", "way_m": 0.5},)
    with pytest.raises(UserError, match="is taken"):
        write_plugin("orbit", "schema")


def test_a_module_that_was_imported_and_is_no_longer_there_takes_no_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "gone", ModuleType("gone"))
    assert write_plugin("gone", "schema") == DONE


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Skippy", "small letters"),
        ("denning", "is taken"),
        ("here", "exists"),
        ("numpy", "module of this name"),
        ("time", "module of this name"),
        ("drivers", "module of this name"),
    ],
)
def test_a_name_that_does_not_do_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "here").mkdir()
    with pytest.raises(UserError, match=said) as caught:
        write_plugin(name, "robot")
    assert caught.value.exit_code == WRONG_CALL

"""The guard of outputs: what every command refuses to overwrite, and what it may write to."""

from __future__ import annotations

import itertools
import os
import shutil
from pathlib import Path

import pytest

from config.errors import FAILED, WRONG_CALL, UserError
from runtime.cli.app import app, run_command
from runtime.cli.commands.output_files import check_outputs, make_output_folder, writing
from runtime.recording.mcap_file import McapFile
from runtime.recording.recorder import Recorder
from runtime.recording.storage import SingleFile
from tests.recorded import hall
from tests.runtime.cli.conftest import HEADER, ROW

RUN_FILE = """
robot = "my_robot.toml"
world = "my_world.toml"
models = ["my_model.toml"]
"""
CALLS: dict[str, tuple[str, ...]] = {
    "run": (
        "run",
        "my.toml",
        "--headless",
        "--no-console",
        "--faults",
        "my_faults.toml",
        "--record {0}",
        "--json {1}",
        "--trace {2}",
        "--set log.file={3}",
    ),
    "run into a ring log": ("run", "my.toml", "--headless", "--record {0}.csv", "--map my_world.toml"),
    "emulate": ("emulate", "--config my.toml", "--faults my_faults.toml", "--trace {0}", "--latency {1}"),
    "experiment": ("experiment", "hallway", "--world my_world.toml", "--model my_model.toml", "--json {0}"),
    "experiment into a folder": ("experiment", "hallway", "--out folder"),
    "scene": ("experiment", "hallway", "--scene clean", "--model my_model.toml", "--json {0}"),
    "budget": ("experiment", "budget", "--model my_model.toml", "--json {0}"),
    "drift": ("experiment", "drift", "--model my_model.toml", "--json {0}"),
    "replay": ("replay", "my.mcap", "--json {0}"),
    "replay of a ring log": (
        "replay",
        "my.csv",
        "--robot my_robot.toml",
        "--localize",
        "--json {0}",
        "--trajectory {1}",
        "--path {2}",
    ),
    "settings": ("settings", "--out {0}"),
    "init": ("init", "run {0}", "--yes"),
    "recover": ("recover", "my.mcap", "--out {0}"),
    "robot with ROS": ("ros2-robot", "--radius 0.3", "--out {0}"),
    "report": ("report", "my.mcap", "--world my_world.toml", "--out {0}"),
    "report of a ring log": ("report", "my.csv", "--robot my_robot.toml", "--out {0}"),
    "figures": ("figures", "my.csv", "--model my_model.toml", "--out folder"),
    "map": ("map", "my.csv", "--set models=['my_model.toml']", "--out {0}", "--grid {1}", "--geojson {2}"),
    "calibrate": ("calibrate", "my.csv", "--robot my_robot.toml", "--out {0}"),
    "stand": ("stand", "my.csv", "--robot my_robot.toml", "--json {0}"),
    "tables": ("export", "my.csv", "--to csv", "--out folder"),
    "ring log": ("export", "my.mcap", "--to ringlog", "--out {0}"),
    "MCAP": ("export", "my.mcap", "--to foxglove", "--out {0}"),
}  # fmt: skip
"""Calls with their inputs as words and their outputs in braces."""
IN_FOLDERS = {"figures": ("raw.svg", "models.png", "overview.mp4"), "tables": ("echoes.csv", "odometry.csv"),
              "experiment into a folder": ("hallway.html", "clusters.pdf")}  # fmt: skip
"""Some of the files that are written into a folder."""
SHIPPED = {"my_robot.toml": "robots/denning.toml", "my_world.toml": "worlds/hallway.toml",
           "my_model.toml": "models/drum.toml"}  # fmt: skip


@pytest.fixture
def inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the working directory, with inputs of every kind and an empty folder."""
    monkeypatch.chdir(tmp_path)
    config = Path(__file__).parents[4] / "config"
    for name, shipped in SHIPPED.items():
        shutil.copyfile(config / shipped, name)
    Path("my.toml").write_text(RUN_FILE)
    Path("my_faults.toml").write_text("")
    Path("my.csv").write_text(f"{HEADER}\n0,0,0,0,{ROW}\n")
    with Recorder(hall(), SingleFile(Path("my.mcap")), clock=lambda: 0.0):
        pass
    Path("folder").mkdir()
    return tmp_path


def words_of(call: str, names: dict[int, str], *more: str) -> list[str]:
    """Return the words of a call with these names of outputs, by number; the others do not exist."""
    outputs = [names.get(k, f"new{k}") for k in range(4)]
    return [word.format(*outputs) for part in CALLS[call] for word in part.split(" ", 1)] + list(more)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def inputs_of(call: str) -> list[str]:
    """Return the files that a call reads, and those which its run file names."""
    named = sorted({word for part in CALLS[call] for word in part.replace("'", " ").split() if Path(word).is_file()})
    return named + ([*SHIPPED] if "my.toml" in named else [])


@pytest.mark.promise("P26")
@pytest.mark.parametrize("call", CALLS)
def test_no_command_overwrites_what_it_reads_writes_or_finds(
    inputs: Path, call: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runtime.cli.commands.export.require_package", lambda *_: None)

    def refused(names: dict[int, str], cause: str, *more: str) -> None:
        before = contents(inputs)
        assert run_command(words_of(call, names, *more)) == WRONG_CALL
        (line,) = [line for line in capfd.readouterr().err.splitlines() if line.startswith("echolocate: ")]
        assert cause in line
        assert contents(inputs) == before, "nothing was written or removed"

    outputs = [k for k in range(4) if any(f"{{{k}}}" in part for part in CALLS[call])]
    suffix = ".csv" if call == "run into a ring log" else ""
    for number, source in enumerate(inputs_of(call)):
        path = Path(f"link{number}{suffix}")
        (Path.symlink_to if (number + len(call)) % 2 else Path.hardlink_to)(path, Path(source).absolute())
        if outputs:
            refused({outputs[number % len(outputs)]: f"link{number}"}, "is an input itself", "--force")
    for k, other in itertools.pairwise(outputs):
        refused({k: "both", other: "./both"}, "is the same file as", "--force")
    for k in outputs:
        if f"log.file={{{k}}}" not in CALLS[call][-1]:
            Path(f"mine{suffix}").write_bytes(b"mine")
            refused({k: "mine"}, "exists; choose another name, or overwrite it with --force")


@pytest.mark.promise("P26")
@pytest.mark.parametrize("call", IN_FOLDERS)
def test_no_command_overwrites_what_it_finds_in_a_folder(
    inputs: Path, call: str, capfd: pytest.CaptureFixture[str]
) -> None:
    for name in IN_FOLDERS[call]:
        path = Path("folder", name)
        path.write_bytes(b"mine")
        assert run_command(words_of(call, {})) == WRONG_CALL
        assert f"--out {path}: exists" in capfd.readouterr().err
        assert path.read_bytes() == b"mine"
        path.unlink()
        if call != "experiment into a folder":
            os.link("my.csv", path)
            before = contents(inputs)
            assert run_command(words_of(call, {}, "--force")) == WRONG_CALL
            assert f"--out {path}: is an input itself: my.csv" in capfd.readouterr().err
            assert contents(inputs) == before
            path.unlink()


def test_a_summary_in_the_folder_is_no_file_of_the_run(inputs: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run_command(words_of("experiment into a folder", {}, "--json", "folder/hallway.mcap")) == WRONG_CALL
    assert "is the same file as --out folder/hallway.mcap" in capfd.readouterr().err
    assert list((inputs / "folder").iterdir()) == []


def test_every_command_that_writes_a_file_is_tried() -> None:
    writing_none = {
        "check",
        "service",
        "probe",
        "ring-test",
        "ros2",
        "foxglove",
        "fleet",
        "--help",
        "-h",
        "--version",
        "--install-completion",
    }
    own_guard = {"firmware", "sweep", "tune"}
    """One keeps each file that was changed, the others take a folder of their own: see test_firmware, test_sweep."""
    assert {words[0] for words in CALLS.values()} == set(app) - writing_none - own_guard


def test_what_holds_nothing_may_be_written_to(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    check_outputs({"--json": tmp_path / "empty"}, force=False)
    os.mkfifo(tmp_path / "pipe")
    check_outputs({"--json": tmp_path / "pipe"}, force=False)
    check_outputs({"--json": "/dev/null", "--trajectory": "/dev/null"}, ("/dev/null",), force=False)


def test_a_file_that_another_process_writes_is_refused_even_by_force(tmp_path: Path) -> None:
    recording = McapFile(tmp_path / "live.mcap", b"{}", 0)
    with pytest.raises(UserError, match="another process writes to this file"):
        check_outputs({"--json": tmp_path / "live.mcap"}, force=True)
    recording.finish()
    check_outputs({"--json": tmp_path / "live.mcap"}, force=True)


def test_a_port_is_an_input_as_well(tmp_path: Path) -> None:
    parent, child = os.openpty()
    (tmp_path / "robot").symlink_to(os.ttyname(child))
    with pytest.raises(UserError, match="is an input itself"):
        check_outputs({"--record": os.ttyname(child)}, (tmp_path / "robot",), force=True)
    os.close(parent)
    os.close(child)


def test_a_link_that_leads_to_no_file_is_the_file_that_it_would_create(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("new")
    with pytest.raises(UserError, match="is the same file as"):
        check_outputs({"--json": tmp_path / "link", "--trace": tmp_path / "new"}, force=True)
    assert not (tmp_path / "new").exists()


def test_an_os_error_names_option_and_path() -> None:
    with (
        pytest.raises(UserError, match=r"^--out x: cannot be written: No space left; choose another") as caught,
        writing("--out", "x"),
    ):
        raise OSError(28, "No space left")
    assert caught.value.exit_code == FAILED


def test_a_file_is_tried_before_the_work_and_keeps_its_content(tmp_path: Path) -> None:
    (tmp_path / "old.json").write_text("{}")
    check_outputs({"--json": str(tmp_path / "old.json"), "--record": None}, force=True)
    assert (tmp_path / "old.json").read_text() == "{}"
    check_outputs({"--json": str(tmp_path / "new.json")}, force=False)
    assert not (tmp_path / "new.json").exists()
    with pytest.raises(
        UserError, match=r"^--json .*/no/x: cannot be written: .*; choose another place or make room$"
    ) as caught:
        check_outputs({"--json": str(tmp_path / "no" / "x")}, force=True)
    assert caught.value.exit_code == FAILED


def test_an_output_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    assert make_output_folder(str(tmp_path / "a" / "b")).is_dir()
    assert make_output_folder(str(tmp_path / "a" / "b")) == tmp_path / "a" / "b"
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="is a file") as caught:
        make_output_folder(str(tmp_path / "file"))
    assert caught.value.exit_code == WRONG_CALL
    with pytest.raises(UserError, match="cannot be written"):
        make_output_folder(str(tmp_path / "file" / "deeper"))

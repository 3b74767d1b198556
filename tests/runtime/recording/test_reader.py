"""Files that are not recordings, or of another version, are refused in one line by every command that reads them."""

from __future__ import annotations

import os
import re
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from mcap.writer import Writer

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.cli.app import run_command
from runtime.recording.channels import CYCLE, RUN_INFO, RawMessage, decode, encode
from runtime.recording.reader import RecordingError, cycle_head, is_recording, open_recording
from runtime.recording.ring_log import read_ring_log
from runtime.recording.schema import FORMAT, Cycle, RunInfo
from tests.recorded import entries_of, hall, rewrite, scanned

FORMS = ("csv", "parquet", "foxglove", "rosbag2", "ringlog")
READING = {
    "replay": ("replay", "{file}"),
    "replay --verify": ("replay", "{file}", "--verify"),
    "replay --with": ("replay", "{file}", "--with", "irregular"),
    "figures": ("figures", "{file}", "--out", "{out}"),
    "report": ("report", "{file}", "--out", "{out}"),
    **{f"export --to {form}": ("export", "{file}", "--to", form, "--out", "{out}") for form in FORMS},
}
COMMANDS = {**READING, "recover": ("recover", "{file}", "--out", "{out}")}
READING_MORE = {
    **COMMANDS,
    "stand": ("stand", "{file}"),
    "map": ("map", "{file}", "--out", "{out}.toml"),
    "calibrate": ("calibrate", "{file}", "--out", "{out}.toml"),
    "emulate": ("emulate", "--faults", "{file}"),
}


def outcome_of(
    command: tuple[str, ...], file: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> tuple[int, str]:
    """Run a command on a file; return its exit code and its error message, which is one line."""
    code = run_command([word.format(file=file, out=out) for word in command])
    err = capsys.readouterr().err
    assert err.startswith("echolocate: "), err
    assert err.count("\n") == 1, err
    return code, err


@pytest.fixture(scope="module")
def newer(hall_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of the next format version."""
    path = tmp_path_factory.mktemp("newer") / "newer.mcap"
    rewrite_as(hall_run, path, FORMAT + 1)
    return path


def rewrite_as(source: Path, path: Path, version: int) -> None:
    """Write a recording again with another format version."""
    first, *rest = entries_of(source)
    info = decode(RunInfo, first.data).model_copy(update={"format": version})
    rewrite([RawMessage(RUN_INFO, first.log_ns, encode(info)), *rest], path, f"echolocate/{version}")


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_wrong_files(command: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    foreign = tmp_path / "foreign.mcap"
    with foreign.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "other")
        writer.finish()
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "picture.mcap").write_bytes(b"\x89PNG\r\n" + bytes(5000))
    (tmp_path / "text.mcap").write_text("t,x,y,theta\n" * 99)
    (tmp_path / "folder.mcap").mkdir()
    why = {
        "empty.mcap": "is empty", "picture.mcap": "", "text.mcap": "",
        "foreign.mcap": "another program ('ros2')",
        "folder.mcap": "Is a directory", "nowhere.mcap": "No such file",
    }  # fmt: skip
    for name, reason in why.items():
        code, line = outcome_of(command, tmp_path / name, tmp_path / "out", capsys)
        assert code == WRONG_CALL
        assert name in line
        assert reason in line
    out = tmp_path / "out"
    assert not out.exists() or not list(out.iterdir()), "nothing was written"


@pytest.fixture(scope="module")
def odd(hall_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording with correct checksums whose cycles have another form."""
    path = tmp_path_factory.mktemp("odd") / "odd.mcap"
    rewrite([e._replace(data=b'{"record": 7}') if e.topic == CYCLE else e for e in entries_of(hall_run)], path)
    return path


@pytest.mark.parametrize("command", READING.values(), ids=READING)
def test_every_command_refuses_another_format_or_form(
    command: tuple[str, ...], newer: Path, odd: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, line = outcome_of(command, newer, tmp_path / "out", capsys)
    assert (code, f"has recording format {FORMAT + 1} " in line) == (WRONG_CALL, True)
    code, line = outcome_of(command, odd, tmp_path / "out", capsys)
    assert (code, "is not valid in this version (record: " in line) == (WRONG_CALL, True)


@pytest.mark.parametrize(
    ("version", "word"), [(FORMAT + 1, "a newer echolocate"), (FORMAT - 1, "the older echolocate")]
)
def test_another_format_is_refused_with_both_versions(run: Path, tmp_path: Path, version: int, word: str) -> None:
    path = tmp_path / "other.mcap"
    rewrite_as(run, path, version)
    with pytest.raises(RecordingError) as caught, open_recording(path):
        pass
    assert str(caught.value).startswith(f"{path}: has recording format {version} (written by echolocate 9)")
    assert f"reads format {FORMAT} only: use {word}" in str(caught.value)


def test_settings_of_another_version_are_refused(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "odd.mcap"
    first, *rest = entries_of(run)
    info = decode(RunInfo, first.data)
    changed = info.model_copy(update={"settings": {**info.settings, "warp": 9}})
    rewrite([first._replace(data=encode(changed)), *rest[:3]], path)
    with (
        pytest.raises(RecordingError, match="its settings are not valid in this version \\(warp: "),
        open_recording(path),
    ):
        pass


def test_a_recording_is_opened_with_its_settings(run: Path) -> None:
    with open_recording(run) as recording:
        assert recording.settings == hall()
        assert recording.world == hall().world
        records = list(recording.cycle_records())
        heads = [cycle_head(message) for message in recording.messages() if message.topic == CYCLE]
        offsets = [offset for offset, _ in recording.chunks()]
        assert recording.finished
    assert heads == [(record.cycle, record.inputs.run_s) for record in records]
    assert cycle_head(RawMessage(CYCLE, 0, b" " + encode(Cycle(record=records[4])))) == heads[4], "decoded if unusual"
    assert offsets == sorted(set(offsets))


def test_a_real_robot_has_no_true_world(run: Path, tmp_path: Path) -> None:
    first, *_ = entries_of(run)
    info = decode(RunInfo, first.data).model_copy(update={"emulated": False})
    rewrite([first._replace(data=encode(info))], tmp_path / "real.mcap")
    with open_recording(tmp_path / "real.mcap") as recording:
        assert recording.world is None


def test_a_recording_is_recognised_by_its_first_bytes_or_its_name(run: Path, tmp_path: Path) -> None:
    (tmp_path / "renamed.csv").write_bytes(run.read_bytes()[:100])
    (tmp_path / "log.csv").write_text("t,x,y,theta,r00\n")
    assert is_recording(tmp_path / "renamed.csv")
    assert is_recording(tmp_path / "absent.mcap")
    assert not is_recording(tmp_path / "log.csv")
    assert not is_recording(tmp_path / "absent.csv")


@pytest.mark.promise("P14")
@pytest.mark.parametrize("name", ["pipe", "pipe.mcap"])
@pytest.mark.parametrize("command", READING_MORE.values(), ids=READING_MORE)
def test_a_pipe_that_without_a_writer(
    command: tuple[str, ...],
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("config.files.PIPE_WAIT_S", 0.05)
    os.mkfifo(tmp_path / name)
    code, line = outcome_of(command, tmp_path / name, tmp_path / "out", capsys)
    assert code == WRONG_CALL
    assert re.search(f"{name}: .*is a (pipe|ring log;)", line)


def test_a_ring_log_from_a_pipe() -> None:
    """A pipe gives its bytes once: finding out what it is takes none of them."""
    read, write = os.pipe()
    log = Path(f"/dev/fd/{read}")
    assert not is_recording(log)
    with os.fdopen(write, "wb") as file:
        file.write(b"t,x,y,theta,r00,r01\n0,0,0,0,1.5,inf\n")
    assert [firing.ranges_m[0] for firing in read_ring_log(log)] == [1.5]
    os.close(read)


def test_a_newer_file_is_recovered_unchanged_or_refused_as_newer(
    newer: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Messages are copied without being decoded; a file without a whole chunk is refused."""
    cut, restored = tmp_path / "cut.mcap", tmp_path / "restored.mcap"
    cut.write_bytes(newer.read_bytes()[:-500])
    assert run_command(["recover", str(cut), "--out", str(restored)]) == DONE
    capsys.readouterr()
    assert entries_of_any(restored) == entries_of_any(newer)
    code, line = outcome_of(READING["replay"], restored, tmp_path / "out", capsys)
    assert (code, f"format {FORMAT + 1} " in line) == (WRONG_CALL, True)
    cut.write_bytes(newer.read_bytes()[:90])
    code, line = outcome_of(COMMANDS["recover"], cut, tmp_path / "none.mcap", capsys)
    assert (code, f"format {FORMAT + 1} " in line) == (WRONG_CALL, True)


def entries_of_any(path: Path) -> list[RawMessage]:
    chunks, _ = scanned(path.read_bytes())
    return [entry for chunk in chunks for entry in chunk]


@contextmanager
def disk_of(size: int) -> Iterator[None]:
    """Limit the files of this process to `size` bytes, as on a disk that fills up.

    Python before 3.13.1 would leave the compiled form of a module cut off there, and every later import would fail.
    """
    before, kept = resource.getrlimit(resource.RLIMIT_FSIZE), sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        sys.dont_write_bytecode = kept


WRITING = {name: command for name, command in COMMANDS.items() if "{out}" in command}
SLOW = ("figures", "report", "export --to rosbag2", "export --to parquet")
"""They write by what the others do, and take most of the time."""


@pytest.mark.compiled
@pytest.mark.parametrize(
    "command",
    [
        pytest.param(command, id=name, marks=[pytest.mark.soak] if name in SLOW else [])
        for name, command in WRITING.items()
    ],
)
def test_a_disk_that_fills_up(
    command: tuple[str, ...], hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with disk_of(2048):
        code, line = outcome_of(command, hall_run, tmp_path / "out", capsys)
    assert code == FAILED
    assert f"{tmp_path / 'out'}" in line
    assert "File too large" in line
    assert not list(tmp_path.glob("*.part"))


def test_a_summary_that_does_not_fit(hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with disk_of(16):
        code, line = outcome_of(("replay", "{file}", "--json", "{out}"), hall_run, tmp_path / "x.json", capsys)
    assert code == FAILED
    assert "--json" in line

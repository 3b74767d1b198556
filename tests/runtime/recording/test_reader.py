"""Every command that reads a recording, on files that are none or too new, or with the disk full: one line."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from mcap.writer import Writer

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.cli.app import run_command
from runtime.recording.channels import CYCLE, RUN_INFO, RawMessage, decode, encode
from runtime.recording.schema import FORMAT, RunInfo
from tests.recorded import entries_of, rewrite

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


def outcome_of(
    command: tuple[str, ...], file: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> tuple[int, str]:
    """Run a command on a file; return its exit code and the one line that it says."""
    code = run_command([word.format(file=file, out=out) for word in command])
    err = capsys.readouterr().err
    assert err.startswith("echolocate: "), err
    assert err.count("\n") == 1, err
    return code, err


@pytest.fixture(scope="module")
def newer(hall_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording as a later version of this program would write it, with a topic that this one does not know."""
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
    (tmp_path / "folder.mcap").mkdir()
    why = {
        "empty.mcap": "is empty", "picture.mcap": "", "foreign.mcap": "another program ('ros2')",
        "folder.mcap": "Is a directory", "nowhere.mcap": "No such file",
    }  # fmt: skip
    for name, reason in why.items():
        code, line = outcome_of(command, tmp_path / name, tmp_path / "out", capsys)
        assert code == WRONG_CALL
        assert name in line
        assert reason in line
    out = tmp_path / "out"
    assert not out.exists() or not list(out.iterdir()), "nothing was written"


@pytest.mark.parametrize("command", READING.values(), ids=READING)
@pytest.mark.parametrize(
    ("version", "word"), [(FORMAT + 1, "a newer echolocate"), (FORMAT - 1, "the older echolocate")]
)
def test_another_format_is_refused_with_both_versions(
    command: tuple[str, ...], version: int, word: str, hall_run: Path, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    path = tmp_path / "other.mcap"
    rewrite_as(hall_run, path, version)
    code, line = outcome_of(command, path, tmp_path / "out", capsys)
    assert code == WRONG_CALL
    assert f"has recording format {version} (written by echolocate 9)" in line
    assert f"reads format {FORMAT} only" in line
    assert word in line


@pytest.mark.parametrize("command", READING.values(), ids=READING)
def test_a_message_of_another_form(
    command: tuple[str, ...], hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whole by its checksum, and written by a version that knew cycles otherwise."""
    odd = tmp_path / "odd.mcap"
    rewrite([e._replace(data=b'{"record": 7}') if e.topic == CYCLE else e for e in entries_of(hall_run)], odd)
    code, line = outcome_of(command, odd, tmp_path / "out", capsys)
    assert code == WRONG_CALL
    assert "is not valid in this version (record: " in line


def test_a_newer_file_is_restored_as_it_is_or_refused_as_newer(
    newer: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its messages need not be understood to be copied; of what no one here can read it is said why."""
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
    from runtime.recording.mcap_scanner import McapScanner

    return [entry for chunk in McapScanner(memoryview(path.read_bytes())).chunks() for entry in chunk]


@contextmanager
def disk_of(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond `size` bytes, as on a disk that fills up."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


WRITING = {name: command for name, command in COMMANDS.items() if "{out}" in command}


@pytest.mark.parametrize("command", WRITING.values(), ids=WRITING)
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

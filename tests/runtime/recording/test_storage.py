"""Where recordings are written: what a run may remove is bounded, named before, and neither pinned nor bookmarked."""

from __future__ import annotations

import os
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from config.load import load_settings
from config.settings import RecordingConfig
from runtime.recording.folder_index import INDEX, create_listed
from runtime.recording.mcap_file import McapFile
from runtime.recording.recorder import Recorder
from runtime.recording.storage import (
    MEGABYTE,
    RotatingFolder,
    SingleFile,
    find_recording,
    has_bookmark,
    list_recordings,
    pin_of,
    recordings_folder,
)
from tests.recorded import hall, until

RUN = "20300101T000000Z-7"
HEADER = bytes.fromhex("894d434150300d0a 01 1400000000000000 0c000000") + b"echolocate/9" + bytes(4)
"""Beginning of a recording."""


def config(*, cap_bytes: int = MEGABYTE, keep: int = 100) -> RecordingConfig:
    settings = load_settings("hallway", [f"recording.keep={keep}"]).recording
    return settings.model_copy(update={"cap_mb": cap_bytes / MEGABYTE})


def older(folder: Path, *sizes: int) -> list[Path]:
    """Write recordings of older runs, the oldest first."""
    files = [folder / f"20200101T{k:06d}Z-1-001.mcap" for k in range(len(sizes))]
    for path, size in zip(files, sizes, strict=True):
        create_listed(path)
        path.write_bytes(HEADER.ljust(size, b"x"))
    return files


def write(target: RotatingFolder, part: int, size: int) -> list[str | None]:
    """Write a file as the recorder does, with a check at its opening and at its end; return the warnings."""
    path = target.begin_part(part)
    first = target.enforce_limits(path)
    path.write_bytes(b"y" * size)
    return [first, target.enforce_limits(path)]


@pytest.mark.compiled
@pytest.mark.promise("P20")
def test_switching_a_hundred_times_removes_no_more_than_was_written(
    tmp_path: Path, measured: Callable[[str], None]
) -> None:
    files = older(tmp_path, *[10_000] * 90)
    target = RotatingFolder(tmp_path, RUN, config(cap_bytes=900_000, keep=90))
    for part in range(1, 101):
        write(target, part, 110)
    assert sum(not path.exists() for path in files) == 1, "11,000 bytes were written"
    measured("100 parts of 110 bytes in a full folder of 90 recordings: 1 of 10,000 bytes removed")


@pytest.mark.compiled
@pytest.mark.promise("P20")
def test_any_run_removes_at_most_its_own_bytes_and_only_what_was_named(tmp_path: Path) -> None:
    rng = random.Random(5)
    for k in range(8):
        folder = tmp_path / str(k)
        folder.mkdir()
        sizes = [rng.randrange(100, 40_000) for _ in range(30)]
        files = older(folder, *sizes)
        pinned = rng.sample(files, 5)
        for path in pinned:
            pin_of(path).touch()
        keep = rng.choice((1, 10, 100))
        target = RotatingFolder(folder, RUN, config(cap_bytes=rng.choice((1_000, 300_000, 10**6)), keep=keep))
        named, written = "", 0
        for part in range(1, 41):
            before = {path for path in files if path.exists()}
            size = rng.randrange(0, 60_000)
            written += size
            warnings = write(target, part, size)
            gone = before - {path for path in files if path.exists()}
            named += "".join(str(warning) for warning in warnings)
            assert all(path.name in named for path in gone), "a person was warned before"
            removed = sum(size for path, size in zip(files, sizes, strict=True) if not path.exists())
            assert removed <= written
        assert all(path.exists() for path in pinned)


def test_the_folder_stays_within_its_limits_while_it_is_written(tmp_path: Path) -> None:
    """Beyond them it is by the largest file at most, once the run has written as much; its own oldest go last."""
    files = older(tmp_path, *[50_000] * 6)
    target = RotatingFolder(tmp_path, RUN, config(cap_bytes=300_000))
    for part in range(1, 31):
        write(target, part, 50_000)
        assert sum(path.stat().st_size for path in tmp_path.iterdir()) <= 400_000
    assert not any(path.exists() for path in files)
    assert (tmp_path / f"{RUN}-030.mcap").exists()


@pytest.mark.compiled
@pytest.mark.promise("P26")
def test_only_files_that_runs_have_written_here_are_removed(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """Not the files of others, whatever they are called and however old they are; not one that is being written."""
    rng = random.Random(6)
    removed = 0
    for k in range(4):
        folder = tmp_path / str(k)
        folder.mkdir()
        files = older(folder, *(rng.randrange(100, 3_000) for _ in range(9)))
        # Of others: by its name, by its header, copied from another folder, in the place of one of ours, a link.
        foreign = [folder / "20190101T000000Z-1-001.mcap", folder / "bag.mcap", folder / "copy.mcap", *files[:2]]
        foreign[0].write_bytes(b"z" * 2_000)
        foreign[1].write_bytes(b"\x89MCAP0\r\n" + b"z" * 2_000)
        foreign[2].write_bytes(HEADER.ljust(2_000, b"z"))
        files[0].write_bytes(b"\x89MCAP0\r\n".ljust(2_000, b"z"))
        files[1].unlink()
        files[1].symlink_to(foreign[2])
        for path in foreign[:3]:
            os.utime(path, (0, 0))
        live = McapFile(files[2], b"{}", 0)
        target = RotatingFolder(folder, RUN, config(cap_bytes=5_000, keep=rng.choice((1, 100))))
        for part in range(1, 20):
            write(target, part, 2_000)
        assert all(path.exists() for path in (*foreign, files[2])), "none of them"
        assert not any(path.exists() for path in files[3:]), "all the others"
        removed += len(files[3:])
        live.finish()
    measured(f"4 folders, twice as full as allowed: {removed} old recordings removed, 0 of 24 other files")


@pytest.mark.promise("P26")
def test_a_clock_that_was_set_back_changes_nothing(tmp_path: Path) -> None:
    """The order is that of the index: neither times nor names of files."""
    files = older(tmp_path, 2_000, 2_000, 2_000)
    for k, path in enumerate(files):
        os.utime(path, (10**9 - k, 10**9 - k))
    target = RotatingFolder(tmp_path, "19700101T000000Z-1", config(cap_bytes=8_000))
    assert "000000Z-1-001.mcap goes next" in str(write(target, 1, 2_000)[1])
    write(target, 2, 2_000)
    assert [path.exists() for path in files] == [False, True, True]


@pytest.mark.promise("P26")
def test_runs_of_the_same_name_share_a_folder(tmp_path: Path) -> None:
    """As of two containers whose processes have the same number: each has files of its own."""
    first, second = (RotatingFolder(tmp_path, RUN, config(cap_bytes=1_000)) for _ in range(2))
    finished = first.begin_part(1)
    written = McapFile(first.begin_part(2), b"{}", 0)
    write(second, 1, 300)
    names = [path.name for path in sorted(tmp_path.glob("*.mcap"))]
    assert names == [f"{RUN}-001.mcap", f"{RUN}-002.mcap", f"{RUN}.2-001.mcap"]
    for part in range(2, 20):
        write(second, part, 9_000)
    assert finished.exists(), "its run goes on"
    assert written.path.exists(), "it is being written"
    written.finish()
    for part in range(20, 23):
        write(second, part, 9_000)
    assert not finished.exists()
    assert not written.path.exists()


def test_a_person_is_warned_which_goes_next_and_how_to_keep_it(tmp_path: Path) -> None:
    first, second = older(tmp_path, 400_000, 400_000)
    target = RotatingFolder(tmp_path, RUN, config())
    current = target.begin_part(1)
    current.write_bytes(b"y" * 50_000)
    assert target.enforce_limits(current) is None, "a tenth is free"
    current.write_bytes(b"y" * 450_000)
    notice = target.enforce_limits(current)
    assert notice is not None
    assert f"{first.name} goes next" in notice
    assert f"create {first.name}.keep beside it" in notice
    assert first.exists()
    (tmp_path / f"{first.name}.keep").touch()
    assert target.enforce_limits(current) is None, "a pinned file does not count"
    assert first.exists()
    assert second.exists()


@pytest.mark.promise("P20")
def test_a_bookmark_pins_its_file(tmp_path: Path) -> None:
    settings = hall("perception.method=paper")
    with Recorder(settings, RotatingFolder(tmp_path, RUN, settings.recording), clock=lambda: 0.0) as recorder:
        until(lambda: recorder.status.is_writing, "a file")
        assert recorder.bookmark("here") is None
    path = Path(str(recorder.status.file))
    assert pin_of(path).exists()
    pin_of(path).unlink()
    assert has_bookmark(path), "by its index, as in recordings of older versions"
    assert pin_of(path).exists()
    another = RotatingFolder(tmp_path, "20310101T000000Z-8", config(cap_bytes=1000, keep=1))
    for part in range(1, 5):
        write(another, part, 10**6)
    assert path.exists()


@pytest.mark.promise("P20")
def test_what_is_switched_off_without_content_is_removed(tmp_path: Path) -> None:
    settings = hall("perception.method=paper")
    with Recorder(settings, RotatingFolder(tmp_path, RUN, settings.recording), clock=lambda: 0.0) as recorder:
        until(lambda: recorder.status.is_writing, "a file")
        for _ in range(100):
            recorder.set_enabled(on=False)
            recorder.set_enabled(on=True)
        recorder.set_enabled(on=False)
    assert (recorder.status.file, recorder.status.files, recorder.status.bytes) == (None, 0, 0)
    assert [path.name for path in tmp_path.iterdir()] == [INDEX]


def test_only_the_file_that_the_user_named_is_replaced(tmp_path: Path) -> None:
    target = SingleFile(tmp_path / "run.mcap")
    assert target.begin_part(1) == tmp_path / "run.mcap"
    (tmp_path / "run.mcap").touch()
    (tmp_path / "run-2.mcap").touch()
    assert target.begin_part(1) == tmp_path / "run.mcap"
    assert target.begin_part(2) == tmp_path / "run-3.mcap"


def test_what_is_no_recording_has_no_bookmark(tmp_path: Path) -> None:
    for content in (b"", b"x" * 1000, b"\x89MCAP0\r\n" * 40):
        (tmp_path / "x.mcap").write_bytes(content)
        assert not has_bookmark(tmp_path / "x.mcap")
    assert not has_bookmark(tmp_path / "none.mcap")


def test_a_file_of_the_user_is_never_split_or_deleted(tmp_path: Path) -> None:
    target = SingleFile(tmp_path / "run.mcap")
    assert [target.begin_part(part).name for part in (1, 2, 11)] == ["run.mcap", "run-2.mcap", "run-11.mcap"]
    assert not target.is_part_full(10**15)
    old = tmp_path / "old.mcap"
    old.touch()
    target.enforce_limits(target.begin_part(1))
    assert old.exists()


def test_a_part_ends_at_its_share_of_the_limit(tmp_path: Path) -> None:
    target = RotatingFolder(tmp_path, RUN, config())
    assert target.is_part_full(250_001)
    assert not target.is_part_full(250_000)


def stored(path: Path, size: int, modified_s: int) -> None:
    path.write_bytes(bytes(size))
    os.utime(path, (modified_s, modified_s))


def test_only_files_of_the_folder_are_recordings(tmp_path: Path) -> None:
    assert list_recordings(tmp_path / "none") == []
    (tmp_path / "folder.mcap").mkdir()
    (tmp_path / "log.jsonl").touch()
    assert list_recordings(tmp_path) == []
    stored(tmp_path / "old.mcap", 3, 100)
    stored(tmp_path / "b.mcap", 0, 200)
    stored(tmp_path / "a.mcap", 7, 200)
    stored(tmp_path / "\udcff.mcap", 7, 300)  # not UTF-8, so no message to the console can name it
    assert list_recordings(tmp_path) == [("a.mcap", 7, 200.0), ("b.mcap", 0, 200.0), ("old.mcap", 3, 100.0)]
    assert find_recording(tmp_path, "old.mcap") == tmp_path / "old.mcap"
    for name in (
        "",
        "none.mcap",
        "folder.mcap",
        "../old.mcap",
        str(tmp_path / "old.mcap"),
        "log.jsonl",
        "./old.mcap",
        "\0.mcap",
    ):
        assert find_recording(tmp_path, name) is None


@pytest.mark.promise("P22")
def test_the_newest_of_many_are_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And none whose name no page could be sent; all are found by their names."""
    monkeypatch.setattr("runtime.recording.storage.LISTED_MAX", 10)
    for k in range(40):
        stored(tmp_path / f"{k}.mcap", 1, 100 + k)
    stored(tmp_path / os.fsdecode(b"\xff.mcap"), 1, 1000)
    assert [file.file for file in list_recordings(tmp_path)] == [f"{k}.mcap" for k in range(39, 29, -1)]
    assert find_recording(tmp_path, "0.mcap") == tmp_path / "0.mcap"


def test_the_folder_of_recordings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/robot")
    monkeypatch.setenv("XDG_STATE_HOME", "/home/robot/state")
    assert recordings_folder(RecordingConfig(folder="~/runs")) == Path("/home/robot/runs")
    assert recordings_folder(RecordingConfig()) == Path("/home/robot/state/echolocate/runs")

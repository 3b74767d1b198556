"""Files that hold no settings: each ends in one clear line, for any content."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from config.files import SIZE_MAX, is_utf8, utf8
from config.load import ConfigError, load_robot, load_settings, load_world
from tests.config.toml_text import ROBOT, document


def message_of(path: str | Path) -> str:
    lines = set()
    for load in (load_robot, load_settings):
        with pytest.raises(ConfigError) as caught:
            load(path)
        lines.add(str(caught.value))
    assert len(lines) == 1
    line = lines.pop()
    assert line.isprintable()
    return line


@pytest.mark.parametrize(
    ("data", "wanted"),
    [
        (b'[ring]\nname = "unended\n', "line 2, column 16: Illegal character"),
        (b'[ring]\nname = "unended', "line 2, column 16 (end of the file): Unterminated string"),
        (b"a = [1, 2", "line 1, column 10 (end of the file): Unclosed array"),
        (b"[ring\ncount = 1", "line 1, column 6: Expected"),
        (b"a = 1\na = 2", "line 2, column 6"),
        (b"a = 1\n[a]\n", "line 2, column 3: Cannot"),
        (b"a = \n", "line 1, column 5: Invalid value"),
        (b"\x7fELF\x02\x01\x01\x00\x00", "line 1, column 1: Invalid statement"),
        (b"\x89PNG\r\n\x1a\n", "line 1: byte 0x89 is not UTF-8 text; save the file as UTF-8"),
        (b"a = 1\nb = 'caf\xe9'\n", "line 2: byte 0xe9 is not UTF-8 text"),
        ("a = 1".encode("utf-16"), "line 1: byte 0xff is not UTF-8 text"),
        (b"a = " + b"[" * 5000, "lists or tables are nested too deeply"),
        (b"a = " + b"[" * 40 + b"]" * 40, "a.0.0.…: lists or tables are nested too deeply"),
        (b".".join([b"a"] * 3000) + b" = 1", "line 1: a.a.a.…: lists or tables are nested too deeply"),
        (b"a = " + b"9" * 6000, "holds a number with far too many digits"),
        (b"[ring]\ncount = 0x" + b"f" * 60, "ring.count: an integer beyond 64 bits"),
        (b"[ring]\ncount = 9223372036854775808", "ring.count: an integer beyond 64 bits"),
        (b"#" * (SIZE_MAX + 1), "larger than 256 KiB, so not a settings file"),
    ],
)
def test_not_settings(data: bytes, wanted: str, tmp_path: Path) -> None:
    path = tmp_path / "odd.toml"
    path.write_bytes(data)
    line = message_of(path)
    assert line.startswith(f"{path}: {wanted}")
    assert len(line) < len(str(path)) + 150


def test_an_empty_file(tmp_path: Path) -> None:
    path = tmp_path / "empty.toml"
    path.write_bytes(b"")
    with pytest.raises(ConfigError) as caught:
        load_robot(path)
    assert str(caught.value) == f"{path}: ring: missing"
    with pytest.raises(ConfigError) as caught:
        load_settings(path)
    assert str(caught.value).startswith(f"{path}: robot: missing")
    assert load_world(path).drum == ()


def test_a_byte_order_mark_and_windows_line_ends_are_accepted(tmp_path: Path) -> None:
    path = tmp_path / "bom.toml"
    path.write_bytes(b"\xef\xbb\xbf" + document(ROBOT).replace("\n", "\r\n").encode())
    assert load_robot(path).body.radius_m == 0.4


def test_a_directory(tmp_path: Path) -> None:
    (tmp_path / "dir.toml").mkdir()
    assert message_of(tmp_path / "dir.toml") == f"{tmp_path}/dir.toml: is a directory, not a TOML file"


def test_a_file_used_as_a_directory(tmp_path: Path) -> None:
    (tmp_path / "f.toml").write_text("")
    assert message_of(tmp_path / "f.toml/g.toml").startswith(f"{tmp_path}/f.toml/g.toml: cannot be read: ")


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is unreadable to root")
def test_an_unreadable_file(tmp_path: Path) -> None:
    path = tmp_path / "secret.toml"
    path.write_text("")
    path.chmod(0)
    assert message_of(path) == f"{path}: cannot be read: Permission denied"


@pytest.mark.parametrize("name", ["./a\0b.toml", "./\ud800.toml", "./a\nb.toml", "./" + "x" * 5000 + ".toml"])
def test_paths_that_no_system_allows(name: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_world(name)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("name", ["", ".", "..", "a\0b", "\ud800", "a\nb", "x" * 5000])
def test_unusual_names(name: str) -> None:
    with pytest.raises(ConfigError, match="no such world") as caught:
        load_world(name)
    assert str(caught.value).isprintable()


def test_what_utf8_cannot_encode_is_escaped() -> None:
    assert is_utf8("Größe 5 °")
    assert not is_utf8("\udcff.mcap")
    assert utf8("Größe \udcff.mcap") == r"Größe \udcff.mcap"


def test_an_endless_device() -> None:
    if not Path("/dev/zero").exists():
        pytest.skip("no such device here")
    assert message_of("/dev/zero").startswith("/dev/zero: larger than")


@pytest.mark.promise("P14")
def test_a_pipe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe from a shell's <(…) is read to its end; a pipe without a writer times out."""
    path = tmp_path / "pipe.toml"
    os.mkfifo(path)
    monkeypatch.setattr("config.files.PIPE_WAIT_S", 0.05)
    reader = os.open(path, os.O_RDWR)
    try:
        assert message_of(path) == f"{path}: is a pipe from which nothing came for 0.05 s; give a file"
    finally:
        os.close(reader)
    monkeypatch.setattr("config.files.PIPE_WAIT_S", 60.0)  # a busy machine starts the thread late
    read, write = os.pipe()
    text = document(ROBOT).encode() + b"#" * 200_000  # more than a pipe holds
    worker = threading.Thread(target=write_all, args=(write, text))
    worker.start()
    assert load_robot(f"/dev/fd/{read}").body.radius_m == 0.4
    worker.join()
    os.close(read)


def write_all(fd: int, data: bytes) -> None:
    with open(fd, "wb") as file:
        file.write(data)

"""A file that is replaced is whole or as before, whatever happens meanwhile."""

from __future__ import annotations

from pathlib import Path

import pytest

from runtime.support.whole_file import whole_file


def test_a_file_is_whole_or_as_before(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("before")

    def interrupted() -> None:
        with whole_file(path) as part:
            part.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        interrupted()
    assert [file.read_text() for file in tmp_path.iterdir()] == ["before"]

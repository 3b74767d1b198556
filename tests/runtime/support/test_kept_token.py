"""The token that is kept across restarts: the same again, private, and made anew only where there is none."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import UserError
from runtime.support.kept_token import NAME, kept_token

FIRST, SECOND = "A" * 22, "B" * 22


def test_the_second_start_has_the_first_ones_token(tmp_path: Path) -> None:
    folder = tmp_path / "state" / "echolocate"
    assert kept_token(folder, lambda: FIRST) == FIRST
    assert kept_token(folder, lambda: SECOND) == FIRST
    assert (folder / NAME).stat().st_mode & 0o777 == 0o600
    assert [one.name for one in folder.iterdir()] == [NAME], "nothing else is left behind"


def test_of_two_processes_that_start_at_once_both_have_one_token(tmp_path: Path) -> None:
    def overtaken() -> str:
        kept_token(tmp_path, lambda: FIRST)
        return SECOND

    assert kept_token(tmp_path, overtaken) == FIRST
    assert [one.name for one in tmp_path.iterdir()] == [NAME]


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620])
def test_a_token_that_others_may_know_is_refused(tmp_path: Path, mode: int) -> None:
    kept_token(tmp_path, lambda: FIRST)
    (tmp_path / NAME).chmod(mode)
    with pytest.raises(UserError, match="delete this file"):
        kept_token(tmp_path, lambda: SECOND)


@pytest.mark.parametrize("content", [b"", b"short", b"A" * 22 + b" B", b"\xff" * 22])
def test_a_file_that_holds_no_token_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / NAME
    path.write_bytes(content)
    path.chmod(0o600)
    with pytest.raises(UserError, match="holds no token"):
        kept_token(tmp_path, lambda: FIRST)


def test_links_and_unwritable_places_are_refused(tmp_path: Path) -> None:
    (tmp_path / NAME).symlink_to("/dev/null")
    with pytest.raises(UserError, match="cannot be kept"):
        kept_token(tmp_path, lambda: FIRST)
    (tmp_path / "file").write_text("", "utf-8")
    with pytest.raises(UserError, match="cannot be kept"):
        kept_token(tmp_path / "file", lambda: FIRST)

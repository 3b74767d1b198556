"""Tests of the user's folders: with a home, without one, and of users that do not exist."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest

from config.errors import WRONG_CALL, UserError
from runtime.support.user_folders import expanded, has_home, state_folder

pytestmark = pytest.mark.promise("P28")


def test_the_state_is_where_the_environment_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", "/somewhere/state")
    assert has_home()
    assert state_folder() == Path("/somewhere/state/echolocate")


def test_without_a_home_folder_the_state_is_temporary_and_private(homeless: Path) -> None:
    assert not has_home()
    folder = state_folder()
    assert folder == state_folder()
    assert folder.parent == homeless / "tmp"
    assert folder.stat().st_mode & 0o777 == 0o700
    assert [file.name for file in homeless.iterdir()] == ["tmp"], "no folder of the name ~"


def test_without_any_folder_it_is_said(homeless: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(homeless / "nowhere"))
    with pytest.raises(UserError, match="no home folder is known, and no temporary folder can be created: No such"):
        state_folder()


@pytest.mark.parametrize("path", ["~nosuchuser/runs", "~/runs", "~"])
def test_the_home_of_a_user_without_one_is_refused(path: str, homeless: Path) -> None:
    with pytest.raises(UserError, match="no home folder is known for ~") as refused:
        expanded(path, "log.file")
    assert refused.value.exit_code == WRONG_CALL
    assert str(refused.value).startswith(f"log.file = '{path}': ")
    assert expanded(f"{homeless}/~", "log.file") == homeless / "~"

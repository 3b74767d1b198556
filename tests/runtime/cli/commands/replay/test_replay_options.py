"""Tests of what `echolocate replay` accepts."""

from __future__ import annotations

import math

import pytest

from config.errors import WRONG_CALL, UserError
from runtime.cli.commands.replay.replay_options import LocalizeOptions, RecordingOptions


@pytest.mark.parametrize(
    ("part", "option"),
    [
        (RecordingOptions(since_s=-1.0), "--from"),
        (RecordingOptions(since_s=math.nan), "--from"),
        (RecordingOptions(until_s=math.inf), "--to"),
        (RecordingOptions(since_s=2.0, until_s=2.0), "--to"),
        (RecordingOptions(speed=0.0), "--speed"),
        (RecordingOptions(speed=-2.0), "--speed"),
        (RecordingOptions(speed=1e-300), "--speed"),
        (LocalizeOptions(trajectory="poses.csv"), "--trajectory"),
        (LocalizeOptions(path="poses.csv"), "--path"),
        (LocalizeOptions(map_file="hallway"), "--map"),
        (LocalizeOptions(localize=True, path="poses.csv", map_file="hallway"), "--path"),
    ],
)
def test_what_cannot_be_is_refused(part: RecordingOptions | LocalizeOptions, option: str) -> None:
    with pytest.raises(UserError, match=f"^{option} ") as caught:
        part.validate()
    assert caught.value.exit_code == WRONG_CALL


def test_what_can_be_is_accepted() -> None:
    RecordingOptions(since_s=1.0, until_s=2.0, speed=0.5).validate()
    LocalizeOptions(localize=True, trajectory="poses.csv", map_file="hallway").validate()
    LocalizeOptions(localize=True, path="poses.csv").validate()

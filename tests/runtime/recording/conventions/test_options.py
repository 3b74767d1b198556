"""Options that describe a ring log."""

from __future__ import annotations

import pytest

from config.errors import UserError
from runtime.recording.conventions.options import AUTO, RingLogOptions


@pytest.mark.parametrize("silence", ["auto", "inf", "nan", "max", "0", "-1", "7.6"])
def test_a_number_or_a_word_stands_for_silence(silence: str) -> None:
    RingLogOptions(silence=silence).check()


@pytest.mark.parametrize("silence", ["none", "", "1e999", "7.6 m"])
def test_other_silence_is_refused(silence: str) -> None:
    with pytest.raises(UserError, match="give auto, inf, nan, max or a number"):
        RingLogOptions(silence=silence).check()


@pytest.mark.parametrize("value", ["auto", "empty", "nan", "inf", "0", "-1"])
def test_a_number_or_a_word_stands_for_not_fired(value: str) -> None:
    RingLogOptions(not_fired=value).check()


@pytest.mark.parametrize("value", ["max", "none", "1e999"])
def test_another_value_for_not_fired_is_refused(value: str) -> None:
    with pytest.raises(UserError, match=r"--not-fired .*: give auto, empty, nan, inf or a number"):
        RingLogOptions(not_fired=value).check()


def test_a_recording_takes_no_options() -> None:
    AUTO.refuse_for("run.mcap")
    with pytest.raises(UserError, match="--heading, --range-unit applies to ring logs only"):
        RingLogOptions(heading="cw", range_unit="ft").refuse_for("run.mcap")

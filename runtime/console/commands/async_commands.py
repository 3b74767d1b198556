"""Handlers of the commands that take time: the emulator's clock, recording, replay, and loading a model.

Each runs as a task of its own, one at a time for each client, so that a HALT from the same page never waits behind a
file that is being opened.
"""

from __future__ import annotations

from collections.abc import Awaitable

from runtime.console.commands.command import Call
from runtime.console.commands.command_error import CommandError
from runtime.console.commands.messages import (
    AddBookmark,
    LoadMap,
    LoadModel,
    NoArguments,
    OpenRecording,
    PlayRecording,
    Record,
    SeekRecording,
    SetSpeed,
    StepRecording,
)
from runtime.console.protocols import RecordingControl, ReplayControl
from runtime.console.sent_messages import ListedRecording, OpenedRecording
from runtime.cycle.modes import Mode
from runtime.timing.time_control import TimeControl


async def load_model(call: Call, model: LoadModel) -> dict[str, str]:
    """Recognise a further model; return its name."""
    return {"name": (await call.context.tuning.add_model(model.toml)).name}


async def load_map(call: Call, given: LoadMap) -> None:
    """Find the robot in a known room from now on; refused while it drives."""
    robot = call.context.robot

    def refusal() -> str | None:
        is_driving = robot.state.mode.mode is Mode.DRIVE
        return "the robot drives, and its goals in the map would move: disarm it first" if is_driving else None

    await call.context.tuning.set_map(given.toml, refusal)


async def pause(call: Call, _: NoArguments) -> None:
    """Pause the run and its emulator."""
    await _refuse_if(_time(call).pause())


async def resume(call: Call, _: NoArguments) -> None:
    """Resume the run and its emulator."""
    await _refuse_if(_time(call).resume())


async def single_step(call: Call, _: NoArguments) -> None:
    """Run one cycle, then pause."""
    await _refuse_if(_time(call).single_step())


async def set_speed(call: Call, speed: SetSpeed) -> None:
    """Run faster or slower than real time."""
    await _refuse_if(_time(call).set_speed(speed.factor))


async def record(call: Call, switch: Record) -> None:
    """Start or stop recording."""
    await _refuse_if(_recording(call).record(on=switch.on))


async def add_bookmark(call: Call, bookmark: AddBookmark) -> None:
    """Add a bookmark to the recording."""
    await _refuse_if(_recording(call).bookmark(bookmark.text))


async def undo_bookmark(call: Call, _: NoArguments) -> str:
    """Withdraw the last bookmark; return its text."""
    return await _recording(call).undo_bookmark()


async def list_recordings(call: Call, _: NoArguments) -> list[ListedRecording]:
    """Return the recordings that can be opened."""
    return await _replay(call).recordings()


async def open_recording(call: Call, recording: OpenRecording) -> OpenedRecording:
    """Show the client a recording in place of the live run; return its description."""
    return await _replay(call).open(call.client, recording.file)


async def seek_recording(call: Call, to: SeekRecording) -> None:
    """Go to a time in the client's recording."""
    await _replay(call).seek(call.client, to.s)


async def play_recording(call: Call, at: PlayRecording) -> None:
    """Play or pause the client's recording."""
    await _replay(call).play(call.client, at.speed)


async def step_recording(call: Call, by: StepRecording) -> None:
    """Go forward or backward in the client's recording by single cycles."""
    await _replay(call).step(call.client, by.cycles)


async def close_recording(call: Call, _: NoArguments) -> None:
    """Show the client the live run again."""
    await _replay(call).close_recording(call.client)


def _time(call: Call) -> TimeControl:
    return call.available(call.context.time)


def _recording(call: Call) -> RecordingControl:
    return call.available(call.context.recording)


def _replay(call: Call) -> ReplayControl:
    return call.available(call.context.replay)


async def _refuse_if(outcome: Awaitable[str | None]) -> None:
    """Wait for an outcome.

    Raises
    ------
    CommandError
        The outcome is a reason why it was not done.
    """
    reason = await outcome
    if reason is not None:
        raise CommandError(reason)

"""What takes its time: holding the emulator's time, recordings, the player. None of it is done in the client's turn.

Each is done by a task of its own, one at once for each client, so that a HALT from the same page never waits behind a
file that is being opened.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, TypeAlias

from runtime.console.commands import messages as forms
from runtime.console.commands.command_error import CommandError
from runtime.console.protocols import NOT_HERE, RecordingControl, ReplayControl, Viewer
from runtime.timing.time_control import TimeControl

Work: TypeAlias = Callable[[], Awaitable[Any]]


class AsyncCommands:
    """Whoever holds the run's time, as far as they are there.

    Parameters
    ----------
    time : TimeControl, optional
        Of the emulator.
    recording : RecordingControl, optional
        Of the run.
    player : ReplayControl, optional
        Of recordings.
    """

    def __init__(
        self,
        time: TimeControl | None = None,
        recording: RecordingControl | None = None,
        player: ReplayControl | None = None,
    ) -> None:
        self.time = time
        self.recording = recording
        self.player = player

    def of(self, viewer: Viewer, message: forms.OfTime) -> Work:
        """Return what does what a message asks for.

        Raises
        ------
        CommandError
            Nobody here can.
        """
        match message:
            case forms.Pause() | forms.Resume() | forms.SingleStep() | forms.Speed() if self.time is not None:
                return _settled(_of_emulator(self.time, message))
            case forms.Record(on=on) if self.recording is not None:
                recording = self.recording
                return _settled(lambda: recording.record(on=on))
            case forms.Bookmark(text=text) if self.recording is not None:
                recording = self.recording
                return _settled(lambda: recording.bookmark(text))
            case (
                forms.Recordings() | forms.Open() | forms.Scrub() | forms.Play() | forms.Step() | forms.Live()
            ) if self.player is not None:  # fmt: skip
                return _of_player(self.player, viewer, message)
        raise CommandError(f"{message.type}: {NOT_HERE}")


def _of_emulator(time: TimeControl, message: forms.OfEmulator) -> Callable[[], Awaitable[str | None]]:
    match message:
        case forms.Pause():
            return time.pause
        case forms.Resume():
            return time.resume
        case forms.SingleStep():
            return time.single_step
        case forms.Speed(factor=factor):
            return lambda: time.set_speed(factor)


def _of_player(player: ReplayControl, viewer: Viewer, message: forms.OfPlayer) -> Work:
    match message:
        case forms.Recordings():
            return player.recordings
        case forms.Open(file=file):
            return lambda: player.open(viewer, file)
        case forms.Scrub(s=s):
            return lambda: player.scrub(viewer, s)
        case forms.Play(speed=speed):
            return lambda: player.play(viewer, speed)
        case forms.Step(cycles=cycles):
            return lambda: player.step(viewer, cycles)
        case forms.Live():
            return lambda: player.live(viewer)


def _settled(ask: Callable[[], Awaitable[str | None]]) -> Work:
    """Return work that refuses with what `ask` returns, where that is anything."""

    async def work() -> None:
        validate = await ask()
        if validate is not None:
            raise CommandError(validate)

    return work

"""The firings of a recording as a ring log, straight from its inputs, for spreadsheets and for `replay`."""

from __future__ import annotations

from pathlib import Path

from drivers.messages import Firing
from runtime.recording.reader import Recording, RecordingError
from runtime.recording.ring_log_rows import write_ring_log
from runtime.recording.servo_columns import ServoColumns


def write_log(recording: Recording, path: Path) -> int:
    """Write the firings of a recording as a ring log and return their number.

    Raises
    ------
    RecordingError
        The recording holds no firing.
    RingLogError
        The file cannot be written.
    """
    firings = recorded_firings(recording)
    heard = [firing.cross_paths for firing in firings if firing.cross_paths is not None]
    pairs = {
        pair for paths in heard for pair in zip(paths.transmitters.tolist(), paths.listeners.tolist(), strict=True)
    }
    write_ring_log(path, firings, sorted(pairs), ServoColumns(recording.settings.ring))
    return len(firings)


def recorded_firings(recording: Recording) -> list[Firing]:
    """Return the firings of a recording, oldest first.

    When a robot restarts, its clock and its odometry restart, which a list cannot represent. Then only the firings
    after the last restart are returned.

    Raises
    ------
    RecordingError
        The recording holds no firing.
    """
    firings: list[Firing] = []
    for record in recording.cycle_records():
        received = record.inputs.received
        if received.rebooted:
            firings.clear()
        firings.extend(received.firings)
    if not firings:
        raise RecordingError(f"{recording.path}: holds no firing: there is nothing to use")
    return firings

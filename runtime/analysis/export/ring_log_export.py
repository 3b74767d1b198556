"""The firings of a recording as a ring log, straight from its inputs: what any spreadsheet reads, and `replay`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from drivers.messages import Firing
from runtime.recording.channels import CYCLE, decode
from runtime.recording.reader import Recording, RecordingError
from runtime.recording.ring_log import write_ring_log
from runtime.recording.schema import Cycle


def write_log(recording: Recording, path: Path) -> int:
    """Write the firings of a recording as a ring log and return how many there are.

    A robot that restarts begins its clock and its odometry anew, which a ring log cannot say; then what follows the
    last start is written.

    Raises
    ------
    RecordingError
        There is no firing in it.
    RingLogError
        The file cannot be written.
    """
    starts = [0, *(i for i, heard in enumerate(_heard(recording)) if heard[1])]
    firings = [firing for group, _ in list(_heard(recording))[starts[-1] :] for firing in group]
    if not firings:
        raise RecordingError(f"{recording.path}: holds no firing: there is nothing to write")
    write_ring_log(path, firings)
    return len(firings)


def _heard(recording: Recording) -> Iterator[tuple[tuple[Firing, ...], bool]]:
    """Yield the firings of each cycle, and whether the robot had restarted before them."""
    for entry in recording.messages():
        if entry.topic == CYCLE:
            heard = decode(Cycle, entry.data).record.inputs.received
            yield heard.firings, heard.rebooted

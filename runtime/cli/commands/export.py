"""`echolocate export`: a run in the form of another program."""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from runtime.cli.commands.offline_io import folder, need, progress, read, writing

if TYPE_CHECKING:
    from runtime.analysis.timeline import Timeline
    from runtime.analysis.timeline_sources import TimelineSource

Form: TypeAlias = Literal["csv", "parquet", "foxglove", "rosbag2", "ringlog"]

NEEDED: Final = MappingProxyType(
    {"parquet": ("pyarrow", "pyarrow"), "foxglove": ("foxglove", "foxglove-sdk"), "rosbag2": ("rosbags", "rosbags")}
)
"""Module and package of each form that core does without."""
EXTRA: Final = "export"


def export_run(source: TimelineSource, form: Form, out: str) -> int:
    """Carry out the command; see `runtime.cli.app.export`."""
    if form in NEEDED:
        need(*NEEDED[form], EXTRA)
    target = Path(out)
    if target.absolute() == Path(source.file).absolute():
        raise UserError(f"--out {out}: is the file itself; choose another name", WRONG_CALL)
    console, told = Console(stderr=True, soft_wrap=True, highlight=False), Console(soft_wrap=True, highlight=False)
    if form == "ringlog":
        told.print(f"{target}: {ring_log(source, target)} firings")
        return DONE
    if form in {"csv", "parquet"}:
        target = folder(out)
    elif form == "rosbag2" and target.exists():
        raise UserError(f"--out {out}: is there already; a bag is a new folder", FAILED)
    timeline = read(source, console)
    with progress(console, "writing"), writing("--out", target):
        for path in write(timeline, form, target):
            told.print(str(path))
    for note in timeline.notes:
        console.print(note)
    return DONE


def write(timeline: Timeline, form: Form, target: Path) -> list[Path]:
    """Write a run in the form source for; each form's package is imported only here."""
    if form == "csv":
        from runtime.analysis.export.csv_tables import write_csv

        return write_csv(timeline, target)
    if form == "parquet":
        from runtime.analysis.export.csv_tables import write_parquet

        return write_parquet(timeline, target)
    if form == "foxglove":
        from runtime.analysis.export.foxglove import write_foxglove

        return write_foxglove(timeline, target)
    from runtime.analysis.export.rosbag import write_bag

    return write_bag(timeline, target)


def ring_log(source: TimelineSource, target: Path) -> int:
    """Write the firings of a recording as a ring log and return how many.

    Raises
    ------
    UserError
        It is no recording, holds no firing, or the log cannot be written.
    """
    from runtime.analysis.export.ring_log_export import write_log
    from runtime.recording.reader import RecordingError, is_recording, open_recording
    from runtime.recording.ring_log import RingLogError

    path = Path(source.file)
    try:
        with open_recording(path) as recording:
            return write_log(recording, target)
    except RecordingError as error:
        said = "" if is_recording(path) else "; a ring log is one already"
        raise UserError(f"{error}{said}", WRONG_CALL) from error
    except RingLogError as error:
        raise UserError(f"--out {error}", FAILED) from error

"""`echolocate export`: convert a run to the format of another program."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from runtime.cli.commands.offline_io import plain_console, read_timeline, require_package
from runtime.cli.commands.output_files import check_outputs, make_output_folder, writing
from runtime.cli.options import Force, Sets
from runtime.cli.source_options import NO_OPTIONS, File, SourceOptions
from runtime.support.progress import progress

if TYPE_CHECKING:
    from runtime.analysis.timeline import Timeline
    from runtime.analysis.timeline_sources import TimelineSource

ExportFormat: TypeAlias = Literal["csv", "parquet", "foxglove", "rosbag2", "ringlog"]

OPTIONAL_PACKAGES: Final = MappingProxyType(
    {"parquet": ("pyarrow", "pyarrow"), "foxglove": ("foxglove", "foxglove-sdk"), "rosbag2": ("rosbags", "rosbags")}
)
"""Module and package that a format needs; they are installed by the extra only."""
EXTRA: Final = "export"


def export(
    file: File,
    /,
    *,
    to: ExportFormat,
    out: str,
    force: Force = False,
    options: SourceOptions = NO_OPTIONS,
    sets: Sets = (),
) -> int:
    """Convert a run to the format of another program; some formats need `pip install 'echolocate[export]'`.

    Parameters
    ----------
    to
        Tables (csv, or parquet*), an MCAP for Foxglove (foxglove*), a ROS 2 bag (rosbag2*), or the firings of a
        recording as a ring log (ringlog). Formats with * need the extra `export`.
    out
        Folder for tables, new folder for a bag, otherwise the file to write.
    force
        Overwrite files that exist already; a bag always needs a new folder.
    file
        Recording or ring log of the run.
    options
        Settings that a recording contains and a ring log does not.
    sets
        Single settings, each `path=value`, that override the others.

    Raises
    ------
    UserError
        A package is missing, the input cannot be read or the output cannot be written.
    """
    if to in OPTIONAL_PACKAGES:
        require_package(*OPTIONAL_PACKAGES[to], EXTRA)
    source, target = options.timeline_source(file, sets), Path(out)
    console, output = plain_console(stderr=True), plain_console()
    if to == "ringlog":
        check_outputs({"--out": target}, source.inputs, force=force)
        output.print(f"{target}: {export_ring_log(source, target)} firings")
        return DONE
    files = [target]
    if to in {"csv", "parquet"}:
        from runtime.analysis.export.csv_tables import NAMES

        target = make_output_folder(out)
        files = [target / f"{name}.{to}" for name in NAMES]
    elif to == "rosbag2":
        if target.exists():
            raise UserError(f"--out {out}: exists; a bag needs a new folder: name another one", WRONG_CALL)
        files = []
    timeline = read_timeline(source, console, partial(check_outputs, {"--out": files}, source.inputs, force=force))
    with progress(console, "writing"), writing("--out", target):
        for path in write_timeline(timeline, to, target):
            output.print(str(path))
    for note in timeline.notes:
        console.print(note)
    return DONE


def write_timeline(timeline: Timeline, to: ExportFormat, target: Path) -> list[Path]:
    """Write a run in a format and return the files; the package of a format is imported only here.

    Parameters
    ----------
    timeline : Timeline
        The run.
    to : str
        The format: csv, parquet, foxglove, or otherwise a ROS 2 bag.
    target : Path
        Folder for tables, new folder for a bag, otherwise the file to write.
    """
    if to == "csv":
        from runtime.analysis.export.csv_tables import write_csv

        return write_csv(timeline, target)
    if to == "parquet":
        from runtime.analysis.export.csv_tables import write_parquet

        return write_parquet(timeline, target)
    if to == "foxglove":
        from runtime.analysis.export.foxglove import write_foxglove

        return write_foxglove(timeline, target)
    from runtime.analysis.export.rosbag import write_bag

    return write_bag(timeline, target)


def export_ring_log(source: TimelineSource, target: Path) -> int:
    """Write the firings of a recording as a ring log and return their number.

    Raises
    ------
    UserError
        The input is not a recording or holds no firing, or the ring log cannot be written.
    """
    from runtime.analysis.export.ring_log_export import write_log
    from runtime.recording.reader import RecordingError, is_recording, open_recording
    from runtime.recording.ring_log import RingLogError

    path = Path(source.file)
    try:
        with open_recording(path) as recording:
            return write_log(recording, target)
    except RecordingError as error:
        hint = "" if is_recording(path) else "; a ring log needs no conversion"
        raise UserError(f"{error}{hint}", WRONG_CALL) from error
    except RingLogError as error:
        raise UserError(f"--out {error}", FAILED) from error

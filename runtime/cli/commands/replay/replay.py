"""`echolocate replay`: a recording cycle by cycle, or perception over a ring log."""

from __future__ import annotations

from pathlib import Path

from config.errors import WRONG_CALL, UserError
from runtime.cli.commands.replay.replay_options import (
    AS_ODOMETRY_SAYS,
    BOTH,
    WHOLE,
    LocalizeOptions,
    RecordingOptions,
    ReplayOptions,
)
from runtime.cli.options import Force
from runtime.cli.source_options import LogOptions
from runtime.recording.conventions.options import AUTO


def replay(
    log: str,
    /,
    *,
    recorded: RecordingOptions = WHOLE,
    localized: LocalizeOptions = AS_ODOMETRY_SAYS,
    both: ReplayOptions = BOTH,
    force: Force = False,
    options: LogOptions = AUTO,
) -> int:
    """Replay a recording cycle by cycle, or run perception over a ring log.

    Parameters
    ----------
    log
        Recording (MCAP), or ring log (CSV with the header t,x,y,theta[,ring_yaw],r00,r01,…).
    recorded
        What only a recording is given.
    localized
        How the drift of a ring log's odometry is corrected.
    both
        What both are given; a recording contains its robot and its models.
    force
        Overwrite files that exist already.
    options
        The conventions of a ring log.

    Raises
    ------
    UserError
        An option that applies to recordings only is given with a ring log.
    """
    from runtime.recording.reader import is_recording

    localized.validate()
    if is_recording(Path(log)):
        if localized.localize:
            raise UserError(f"{log}: is a recording; --localize applies to ring logs only", WRONG_CALL)
        options.refuse_for(log)
        from runtime.cli.commands.replay.replay_recording import replay_recording

        return replay_recording(log, both, recorded, force=force)
    if recorded != WHOLE:
        raise UserError(
            f"{log}: is a ring log; --verify, --with, --from, --to and --speed apply to recordings (MCAP) only",
            WRONG_CALL,
        )
    from runtime.cli.commands.replay.replay_ring_log import replay_log

    return replay_log(log, both, localized, options, force=force)

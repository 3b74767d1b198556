"""`echolocate recover`: what can be read of a damaged recording, as a whole one."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL, UserError

SHOWN: Final = 10
"""Damages told one by one."""


def recover_recording(source: str, out: str | None) -> int:
    """Carry out the command; see `runtime.cli.app.recover`."""
    from runtime.recording.recovery import recover

    path = Path(source)
    target = path.with_name(f"{path.stem}-recovered.mcap") if out is None else Path(out)
    if target.absolute() == path.absolute():
        raise UserError(f"--out {out}: is the damaged file itself; choose another name", WRONG_CALL)
    try:
        got = recover(path, target)
    except OSError as error:
        raise UserError(
            f"{target}: cannot be written: {error.strerror or error}; choose another place by --out", FAILED
        ) from error
    console = Console(soft_wrap=True, highlight=False)
    for region in got.corrupt_regions[:SHOWN]:
        console.print(str(region))
    if len(got.corrupt_regions) > SHOWN:
        console.print(f"and {len(got.corrupt_regions) - SHOWN} more")
    state = (
        "was closed in good order" if got.finished else "had not been closed: the run was cut off, or the file was"
    )
    console.print(
        f"{target}: {got.cycles} cycles, {got.messages} messages in {got.chunks} chunks, "
        f"{1e-9 * (got.last_ns - got.first_ns):.1f} s; the original {state}"
    )
    return DONE

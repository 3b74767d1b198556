"""`echolocate recover`: restore what can be read of a damaged recording."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL, UserError

SHOWN_MAX: Final = 10
"""Damaged places that are listed."""


def recover_recording(source: str, out: str | None) -> int:
    """Write what can be read of a recording into a new one and return the exit code.

    Raises
    ------
    UserError
        The input is not a recording, or the output cannot be written.
    """
    from runtime.recording.recovery import recover

    path = Path(source)
    target = path.with_name(f"{path.stem}-recovered.mcap") if out is None else Path(out)
    if target.absolute() == path.absolute():
        raise UserError(f"--out {out}: is the input itself; choose another name", WRONG_CALL)
    try:
        recovered = recover(path, target)
    except OSError as error:
        raise UserError(
            f"{target}: cannot be written: {error.strerror or error}; choose another place with --out", FAILED
        ) from error
    console = Console(soft_wrap=True, highlight=False)
    for region in recovered.corrupt_regions[:SHOWN_MAX]:
        console.print(str(region))
    if len(recovered.corrupt_regions) > SHOWN_MAX:
        console.print(f"and {len(recovered.corrupt_regions) - SHOWN_MAX} more")
    state = "was complete" if recovered.finished else "was not closed: the run or the file was cut off"
    console.print(
        f"{target}: {recovered.cycles} cycles, {recovered.messages} messages in {recovered.chunks} chunks, "
        f"{1e-9 * (recovered.last_ns - recovered.first_ns):.1f} s; the original {state}"
    )
    return DONE

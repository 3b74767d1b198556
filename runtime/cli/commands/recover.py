"""`echolocate recover`: restore what can be read of a damaged recording."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from config.errors import DONE, WRONG_CALL, UserError
from runtime.cli.commands.output_files import check_outputs, writing
from runtime.cli.options import Force
from runtime.cli.terminal.escaping_console import EscapingConsole

SHOWN_MAX: Final = 10
"""Damaged places that are listed."""


def recover(recording: str, /, *, out: str | None = None, force: Force = False) -> int:
    """Restore what can be read of a damaged or incomplete recording.

    Parameters
    ----------
    recording
        Damaged file; it is not changed.
    out
        File to write; by default NAME-recovered.mcap in the same folder.
    force
        Overwrite it if it exists already.

    Raises
    ------
    UserError
        The input is not a recording, or the output cannot be written.
    """
    from runtime.recording.recovery import recover as restore

    path = Path(recording)
    target = path.with_name(f"{path.stem}-recovered.mcap") if out is None else Path(out)
    if target.exists() and not target.is_file():
        raise UserError(f"--out {target}: is not a file; choose another name", WRONG_CALL)
    check_outputs({"--out": target}, (recording,), force=force)
    with writing("--out", target):
        recovered = restore(path, target)
    console = EscapingConsole(soft_wrap=True, highlight=False)
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

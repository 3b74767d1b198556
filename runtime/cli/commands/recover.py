"""`echolocate recover`: restore what can be read of a damaged recording."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from config.errors import DONE, WRONG_CALL, UserError
from runtime.cli.commands.output_files import check_outputs, writing
from runtime.cli.terminal.escaping_console import EscapingConsole

SHOWN_MAX: Final = 10
"""Damaged places that are listed."""


def recover_recording(source: str, out: str | None, *, force: bool) -> int:
    """Write what can be read of a recording into a new one and return the exit code.

    Parameters
    ----------
    source, out, force
        As of `runtime.cli.recording_commands.recover`.

    Raises
    ------
    UserError
        The input is not a recording, or the output cannot be written.
    """
    from runtime.recording.recovery import recover

    path = Path(source)
    target = path.with_name(f"{path.stem}-recovered.mcap") if out is None else Path(out)
    if target.exists() and not target.is_file():
        raise UserError(f"--out {target}: is not a file; choose another name", WRONG_CALL)
    check_outputs({"--out": target}, (source,), force=force)
    with writing("--out", target):
        recovered = recover(path, target)
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

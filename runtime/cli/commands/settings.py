"""`echolocate settings`: every key of every file, found by a text, or written as a page."""

from __future__ import annotations

from pathlib import Path

from rich.padding import Padding
from rich.text import Text

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from runtime.cli.commands.output_files import check_outputs
from runtime.cli.options import Force
from runtime.cli.terminal.escaping_console import EscapingConsole


def settings(text: str = "", /, *, out: str | None = None, force: Force = False) -> int:
    """List the keys of all files with values, defaults and meaning.

    Parameters
    ----------
    text
        List only keys whose name or meaning contains this.
    out
        Write the whole list into this file, as Markdown.
    force
        Overwrite an existing file.

    Raises
    ------
    UserError
        No key contains the text, the page was asked for a part of the keys, or the file cannot be written.
    """
    from config.reference import FILES, markdown, settings_of

    if out is not None and text:
        raise UserError(
            f"--out writes the page of all keys, not of those with {text!r}: leave out either of them", WRONG_CALL
        )
    if out is not None:
        check_outputs({"--out": out}, (), force=force)
        try:
            Path(out).write_text(markdown(), "utf-8")
        except OSError as error:
            raise UserError(f"cannot write {out}: {error.strerror}", FAILED) from error
        return DONE
    wanted = text.lower()
    console, count = EscapingConsole(), 0
    for file, _, _ in FILES:
        for found in settings_of(file):
            if wanted in found.path.lower() or wanted in found.help.lower():
                count += 1
                console.print(Text.assemble((found.path, "bold"), f" = {found.default or '…'}", style="none"))
                value = ", ".join(part for part in (found.type, found.bounds) if part)
                console.print(Padding(Text(f"{file} file: {value}", style="dim"), (0, 0, 0, 4), expand=False))
                console.print(Padding(Text(found.help), (0, 0, 0, 4), expand=False))
    if not count:
        raise UserError(f"no setting contains {text!r}: call `echolocate settings` for all of them", WRONG_CALL)
    return DONE

"""docs/commands.md, made from what the commands declare: `python -m tests.command_page` writes it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from runtime.cli.app import app, show_whole_help

PAGE: Final = Path(__file__).resolve().parents[1] / "docs" / "commands.md"
HEADER: Final = """# Commands

Every command with its arguments and options, made from the program by `python -m tests.command_page`. Options that
many commands have: `--set section.key=value` overrides a setting, `--json FILE` writes a summary, `--headless`
disables the live view. A command never writes into a file that it reads, also not through a link; it overwrites a
file that exists only with `--force`. Exit codes: 0 done, 1 the work failed, 2 the call or the configuration wrong,
3 no fault found, but not all could be shown to be good (`ring-test`), 128 + n ended by signal n before the run began.
"""
"""The first lines of the page, in place of the program's own."""


def page() -> str:
    """Return the page, in Markdown."""
    for name in app:
        show_whole_help(name)
    text = app.generate_docs(output_format="markdown", recursive=True)
    # It takes `python -m` for a part of the name.
    text = re.sub(r"^(echolocate .*?)-m \S+ ", r"\1", text, flags=re.MULTILINE)
    return HEADER + "\n" + text[text.index("**Robot**") :].rstrip() + "\n"


def words(text: str) -> list[str]:
    """Return the words of a page and the names of its options, without what only sets them."""
    return re.findall(r"[\w.-]+", text)


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")

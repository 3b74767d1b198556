"""The page that leads through a new driver quotes the example as it is."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
FOLDER = Path(__file__).parent


def test_what_the_page_quotes_is_in_the_example() -> None:
    page = (ROOT / "docs" / "extending.md").read_text("utf-8")
    section = page[page.index("## A robot") : page.index("## Faults on schedule")]
    quotes = [textwrap.dedent(text) for text in re.findall(r"```python\n(.*?)\n *```", section, re.DOTALL)]
    files = [*(FOLDER / "example").glob("*.py"), FOLDER / "families.py"]
    sources = [path.read_text("utf-8") for path in files]
    assert len(quotes) >= 2
    for quote in quotes:
        in_class = textwrap.indent(quote, "    ")
        assert any(quote in source or in_class in source for source in sources), quote

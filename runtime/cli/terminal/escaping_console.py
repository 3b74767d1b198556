"""A console on which no text acts: neither as a control sequence of the terminal nor as markup of rich.

What commands print comes from robots, recordings, file names and settings of others.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import IO, Any, Final

from rich.console import Console, ConsoleOptions, HighlighterType, JustifyMethod, OverflowMethod, RenderableType
from rich.measure import Measurement
from rich.segment import Segment
from rich.style import Style
from rich.table import Table
from rich.text import Text

WIDTH_MAX: Final = 10_000
"""Width of a console without end."""


class EscapingConsole(Console):
    """A console that escapes whatever is not printable, in strings, tables and texts alike.

    Parameters
    ----------
    file : text stream, optional
        Where it prints; by default standard output.
    stderr : bool
        Whether it prints on standard error instead.
    soft_wrap : bool
        Whether lines are left as long as they are.
    highlight : bool
        Whether numbers and paths are coloured.
    """

    def __init__(
        self, file: IO[str] | None = None, *, stderr: bool = False, soft_wrap: bool = False, highlight: bool = True
    ) -> None:
        super().__init__(
            file=file, stderr=stderr, soft_wrap=soft_wrap, highlight=highlight, markup=False, emoji=False
        )  # fmt: skip

    @property
    def can_draw(self) -> bool:
        """Whether a view can be drawn on it: a terminal that moves its cursor."""
        return self.is_terminal and not self.is_dumb_terminal

    def print(self, *objects: Any, **options: Any) -> None:  # noqa: ANN401 - as rich's
        """Print as rich does, but no column of a table narrower than its longest word: rich would cut numbers.

        On a terminal that is too narrow a table has no lines; if that does not suffice, the terminal wraps it.
        Without a terminal a table has its own width.
        """
        wide = self.options.update(max_width=WIDTH_MAX)
        for table in (each for each in objects if isinstance(each, Table)):
            for column in table.columns:
                cells = [Measurement.get(self, wide, cell) for cell in (column.header, *column.cells)]
                is_whole = column.no_wrap or not self.is_terminal
                column.min_width = max(cell.maximum if is_whole else cell.minimum for cell in cells)
            if self.is_terminal and Measurement.get(self, wide, table).minimum > self.width:
                table.box, table.padding, table.pad_edge = None, (0, 1, 0, 0), False
            least = Measurement.get(self, wide, table).minimum
            if least > self.width:
                table.width = least  # or rich takes the whole width of a column
            options["crop"] = False
        super().print(*objects, **options)

    def render_str(
        self,
        text: str,
        *,
        style: str | Style = "",
        justify: JustifyMethod | None = None,
        overflow: OverflowMethod | None = None,
        emoji: bool | None = None,
        markup: bool | None = None,
        highlight: bool | None = None,
        highlighter: HighlighterType | None = None,
    ) -> Text:
        """Return a string as a text, escaped before it is laid out."""
        return super().render_str(
            escaped(text), style=style, justify=justify, overflow=overflow, emoji=emoji, markup=markup,
            highlight=highlight, highlighter=highlighter,
        )  # fmt: skip

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the segments of a renderable; nested ones pass here as well."""
        for segment in super().render(renderable, options):
            is_safe = segment.control or segment.text.isprintable() or segment.text == "\n"
            yield segment if is_safe else Segment(escaped(segment.text), segment.style)


def escaped(text: str) -> str:
    """Return a text with everything escaped that is not printable, but for newlines."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)

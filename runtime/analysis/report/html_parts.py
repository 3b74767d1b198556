"""Parts of a page: escaped text, tables, tiles. All content is escaped, so that it never becomes markup."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from pydantic import BaseModel


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, text: bool = False) -> str:
    """Return a table.

    Cells are aligned for words (`text`) rather than for numbers.
    """
    head = "".join(f"<th>{escape(h)}</th>" for h in headings)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    kind = ' class="text"' if text else ""
    return f'<div class="card"><table{kind}><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def tile(value: str, label: str) -> str:
    """Return a key figure with its label."""
    return f'<div class="tile"><b>{escape(value)}</b><span>{escape(label)}</span></div>'


def section(title: str, *content: str) -> str:
    """Return a section; an empty string if it has no content."""
    inside = "".join(content)
    return f"<section><h2>{escape(title)}</h2>{inside}</section>" if inside else ""


def note(text: str, *, bad: bool = False) -> str:
    """Return a paragraph of small print."""
    return f'<p class="{"bad" if bad else "note"}">{escape(text)}</p>'


def flattened(model: BaseModel, path: str = "") -> list[tuple[str, str]]:
    """Return every setting as a dotted path, as `--set` takes it, and its value."""
    rows: list[tuple[str, str]] = []
    for name in type(model).model_fields:
        value = getattr(model, name)
        where = f"{path}{name}"
        if isinstance(value, BaseModel):
            rows += flattened(value, f"{where}.")
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for i, item in enumerate(value):
                rows += flattened(item, f"{where}.{i}.")
        elif value is not None:
            rows.append((where, value if isinstance(value, str) else f"{value}"))
    return rows


def settings_list(model: BaseModel) -> str:
    """Return all settings, in columns."""
    rows = "".join(f"<div>{escape(k)} <span>=</span> {escape(v)}</div>" for k, v in flattened(model))
    return f'<div class="card"><div class="settings">{rows}</div></div>'

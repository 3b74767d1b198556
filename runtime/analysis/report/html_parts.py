"""Pieces of a page: escaped text, tables, tiles. Whatever stands in a file is text here and never markup."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from pydantic import BaseModel


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, text: bool = False) -> str:
    """Return a table; `text` for words rather than numbers."""
    head = "".join(f"<th>{escape(h)}</th>" for h in headings)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    kind = ' class="text"' if text else ""
    return f'<div class="card"><table{kind}><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def tile(value: str, told: str) -> str:
    """Return a number that counts, and what it is."""
    return f'<div class="tile"><b>{escape(value)}</b><span>{escape(told)}</span></div>'


def section(title: str, *content: str) -> str:
    """Return a section, nothing where it has no content."""
    inside = "".join(content)
    return f"<section><h2>{escape(title)}</h2>{inside}</section>" if inside else ""


def note(text: str, *, bad: bool = False) -> str:
    """Return a paragraph of small print."""
    return f'<p class="{"bad" if bad else "note"}">{escape(text)}</p>'


def flattened(model: BaseModel, path: str = "") -> list[tuple[str, str]]:
    """Return every setting by its dotted path, as one would set it."""
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

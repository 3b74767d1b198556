"""A line of the log as a sentence: what happened, why, and in brackets what else is known of it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

UNITS: Final = MappingProxyType(
    {"us": "µs", "ms": "ms", "s": "s", "m": "m", "rad": "rad", "bytes": "bytes", "hz": "Hz"}
)
"""The last word of a field's name, as a person reads it. The page's `log.js` forms the same sentences."""
NOTHING: Final = frozenset({"", "None", "null"})


def sentence(event: str, fields: Mapping[str, object]) -> str:
    """Return the sentence, as "Mode SAFE_STOP: HALT by the operator (cycle 12)".

    Parameters
    ----------
    event : str
        What happened. A field of that name describes it, and a field "reason" says why.
    fields : mapping
        What else is known; fields without a value are left out.
    """
    known = {name: text for name, value in fields.items() if (text := field_text(value)) not in NOTHING}
    what, reason = known.pop(event, None), known.pop("reason", None)
    head = event if what is None else f"{event} {what}"
    said = f"{head[:1].upper()}{head[1:]}{'' if reason is None else f': {reason}'}"
    if known:
        return f"{said} ({', '.join(_detail(name, text) for name, text in known.items())})"
    return said if said.endswith((".", "!", "?")) else f"{said}."


def field_text(value: object) -> str:
    """Return a field's value as text, the entries of a list one after another."""
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def _detail(name: str, text: str) -> str:
    """Return a field in words: `took_s`, 1.5 as "took 1.5 s"; a flag is named alone."""
    head, _, end = name.rpartition("_")
    unit = f" {UNITS[end]}" if head and end in UNITS else ""
    words = (head if unit else name).replace("_", " ")
    if text in {"True", "False"}:
        return words if text == "True" else f"not {words}"
    return text if text.startswith(f"{words} ") else f"{words} {text}{unit}"

"""The text of a robot file from its tables, for a form or a command that writes one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import tomli_w


def robot_text(tables: Mapping[str, Mapping[str, Any]], head: Sequence[str]) -> str:
    """Return a robot file as TOML, a sensor a line; values that are None are left out.

    Parameters
    ----------
    tables
        The sections by name, as `config.robot.RobotConfig` has them; a mapping in `ring.sensors` a sensor.
    head
        Lines of comment at the beginning.
    """
    sections = {name: {k: v for k, v in table.items() if v is not None} for name, table in tables.items()}
    ring = sections.get("ring", {})
    sensors = ring.pop("sensors", None)
    text = tomli_w.dumps({name: table for name, table in sections.items() if table})
    if sensors is not None:
        rows = "".join(f"    {{ {', '.join(f'{k} = {_plain(v)}' for k, v in row.items())} }},\n" for row in sensors)
        text = text.replace("[ring]\n", f"[ring]\nsensors = [\n{rows}]\n", 1)
    return "".join(f"# {line}\n" for line in head) + f"\n{text}"


def _plain(value: object) -> str:
    """Return a plain value as TOML."""
    return tomli_w.dumps({"x": value}).removeprefix("x = ").strip()

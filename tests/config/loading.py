"""Files to load, and the problems of a load that fails."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from config.load import ConfigError, load_settings
from tests.config.toml_text import document


def write(path: Path, table: dict[str, Any] | str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(table if isinstance(table, str) else document(table), encoding="utf-8")
    return path


def problems(*args: Any, **kwargs: Any) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_settings(*args, **kwargs)
    assert str(caught.value).splitlines() == list(caught.value.problems)
    return list(caught.value.problems)


def problem(*args: Any, **kwargs: Any) -> str:
    lines = problems(*args, **kwargs)
    assert len(lines) == 1, lines
    return lines[0]

"""Measure in rooms or halls with the settings of the hallway, and write and print what is measured."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeVar

from rich.console import Console
from rich.table import Table

from bench.table import report
from config.load import load_settings
from config.settings import Settings
from runtime.support.kernel_warmup import prepare_kernels

Rows = TypeVar("Rows")

BY_BAYES: Final = ("perception.method=bayes",)
"""The setting of benches that are about the Bayesian method."""


def try_in_rooms(
    measure: Callable[[Settings, Callable[[str], None]], Rows],
    table: Callable[[Rows], Table],
    json: str,
    sets: tuple[str, ...] = (),
    parts: tuple[str, ...] | None = None,
) -> int:
    """Write and print what is measured in rooms or halls, with these settings and parts of the kernels."""
    console = Console(stderr=True)
    settings = load_settings("hallway", sets)
    prepare_kernels(settings, console, parts)
    with console.status("bench") as status:
        rows = measure(settings, status.update)
    return report(json, rows, table(rows))

"""Compile every kernel before tests start: `python -m tests.compile_kernels`; quick if they are compiled already."""

from __future__ import annotations

from rich.console import Console

from config.load import load_settings
from runtime.support.kernel_cache import PARTS
from runtime.support.kernel_warmup import prepare_kernels


def compile_all() -> None:
    """Compile every kernel that is not in the cache, and load all of them."""
    prepare_kernels(load_settings("hallway"), Console(stderr=True), PARTS)


if __name__ == "__main__":
    compile_all()

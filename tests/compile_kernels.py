"""Compile every kernel before tests start: `python -m tests.compile_kernels`; quick if they are compiled already."""

from __future__ import annotations

import contextlib
from unittest import mock

from rich.console import Console

from config.load import load_settings
from runtime.support import kernel_warmup
from runtime.support.kernel_cache import PARTS


def compile_all(*, in_one_process: bool = False) -> None:
    """Compile every kernel that is not in the cache, and load all of them.

    Parameters
    ----------
    in_one_process : bool
        Where other work has the second processor: two processes compile what their kernels share twice.
    """
    nothing = contextlib.nullcontext()
    with mock.patch.object(kernel_warmup, "compile_in_parallel", return_value=nothing) if in_one_process else nothing:
        kernel_warmup.prepare_kernels(load_settings("hallway"), Console(stderr=True), PARTS)


if __name__ == "__main__":
    compile_all()

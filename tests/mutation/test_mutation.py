"""Tests of the mutants, and (in the long form) that the tests detect them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable

import pytest

from tests.mutation.accepted import ACCEPTED
from tests.mutation.campaign import KILLED_MIN, ROOT, TARGETS
from tests.mutation.mutants import mutants

SOURCE = '''
"""A text."""
LIMIT: Final = 3
Name: TypeAlias = Literal["b"]

class Example:
    """Another."""
    def whole(self, a: float, *, least: int = 1) -> float | None:
        """A third."""
        if a < LIMIT and not least:
            raise ValueError(f"{a + 1} is too little, at least 3")
        self.seen += 1
        return min(a, -2.0)
'''


def test_each_mutant_is_one_small_change() -> None:
    found = list(mutants(SOURCE))
    assert [(m.before, m.after) for m in found if m.where.startswith("module")] == [("3", "4")]
    assert [m.key for m in found if m.where.startswith("Example")] == [
        "Example.whole: 1 → 2",
        "Example.whole: a < LIMIT and (not least) → not (a < LIMIT and (not least))",
        "Example.whole: a < LIMIT and (not least) → a < LIMIT or not least",
        "Example.whole: a < LIMIT → a <= LIMIT",
        "Example.whole: not least → least",
        "Example.whole: raise ValueError(f'{a + 1} is too little, at least 3') → pass",
        "Example.whole: self.seen += 1 → self.seen -= 1",
        "Example.whole #2: 1 → 2",
        "Example.whole: return min(a, -2.0) → return None",
        "Example.whole: min → max",
        "Example.whole: -2.0 → 2.0",
        "Example.whole: 2.0 → 3.0",
    ]
    assert len({m.source for m in found}) == len(found)


def test_accepted_mutants_exist() -> None:
    """A reason is removed together with its module or line."""
    for module, reasons in ACCEPTED.items():
        keys = {m.key for m in mutants((ROOT / module).read_text("utf-8"))}
        assert reasons.keys() <= keys, reasons.keys() - keys
        assert all(len(reason) > 10 for reason in reasons.values())


@pytest.mark.soak
@pytest.mark.parametrize("module", TARGETS)
def test_mutants_are_detected(module: str, record_property: Callable[[str, object], None]) -> None:
    """At least 85 % are killed, and every survivor has a reason."""
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "tests.mutation.campaign", module]
    done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=3600, check=False)
    assert done.returncode == 0, f"killed less than {KILLED_MIN:.0%}, or a survivor without reason:\n{done.stdout}"
    record_property("measured", done.stdout.splitlines()[0])

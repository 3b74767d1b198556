"""No compiled kernel is stale: whatever it depends on is in its digest, and nothing else is."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import pytest

from perception import kernel_compiler, kernel_digest
from perception.bayes.tracks import refine
from perception.kernel_digest import KernelDigests, tools_digest
from runtime.support.child_process import child_environment
from tests.line_coverage import MeasuredFiles

pytestmark = pytest.mark.compiled

SOURCE: Final = '''
import math
import numpy as np
from perception.kernel import kernel, loop_kernel

LIMIT = 2.5
TABLE = np.array([1.0, 2.0])
SIZES = (3, (4.0, "text"))
KIND = np.dtype([("x", np.float64)])
OTHER = 7

@kernel
def inner(x, power=2):
    return x * LIMIT + power

@kernel
def outer(values):
    """Return a sum."""
    total = 0.0
    for k in range(values.shape[0]):
        total += inner(values[k]) + math.sqrt(TABLE[0]) + SIZES[0]
    return total

def unused(x):
    return x
'''
"""A file with a kernel that calls another one."""

DEPENDS: Final = MappingProxyType({
    "its own code": ("total = 0.0", "total = 1.0"),
    "a name in it": ("values.shape[0]", "values.size"),
    "a constant of what it calls": ("LIMIT = 2.5", "LIMIT = 2.4"),
    "the type of a constant": ("LIMIT = 2.5", "LIMIT = np.float32(2.5)"),
    "the code of what it calls": ("x * LIMIT + power", "x * LIMIT - power"),
    "a default of what it calls": ("power=2", "power=3"),
    "an array": ("np.array([1.0, 2.0])", "np.array([1.5, 2.0])"),
    "an array's type": ("np.array([1.0, 2.0])", "np.array([1, 2])"),
    "a tuple in a tuple": ('(4.0, "text")', '(4.5, "text")'),
    "how what it calls is compiled": ("@kernel\ndef inner", "@loop_kernel\ndef inner"),
    "another function of math": ("math.sqrt", "math.exp"),
})  # fmt: skip
INDEPENDENT: Final = MappingProxyType({
    "nothing": ("", ""),
    "a constant that it does not use": ("OTHER = 7", "OTHER = 8"),
    "another function": ("    return x\n", "    return -x\n"),
    "its docstring": ("Return a sum.", "Return the sum."),
    "its line": ("import math\n", "import math\n\n\n# a comment\n"),
})  # fmt: skip


def digest(source: str, tools: str = "", file: str = "one.py") -> str:
    names: dict[str, Any] = {"__name__": "a_file"}
    exec(compile(source, file, "exec"), names)
    return KernelDigests(tools).of(names["outer"], "(array(float64, 1d, C),)")


def changed(old: str, new: str) -> str:
    assert old in SOURCE
    return SOURCE.replace(old, new, 1)


@pytest.mark.parametrize("what", DEPENDS)
def test_what_machine_code_depends_on_changes_the_digest(what: str) -> None:
    assert digest(changed(*DEPENDS[what])) != digest(SOURCE)


@pytest.mark.parametrize("what", INDEPENDENT)
def test_what_it_does_not_depend_on_leaves_the_digest(what: str) -> None:
    assert digest(changed(*INDEPENDENT[what]), file="/another/place.py") == digest(SOURCE)


def test_tools_and_types_are_in_the_digest() -> None:
    assert digest(SOURCE, "a") != digest(SOURCE, "b")
    names: dict[str, Any] = {"__name__": "a_file"}
    exec(SOURCE, names)
    assert len({KernelDigests("").of(names["outer"], types) for types in ("(float64,)", "(int64,)")}) == 2


def test_the_functions_of_our_compiler_are_among_the_tools(monkeypatch: pytest.MonkeyPatch) -> None:
    names = dict(vars(kernel_compiler))
    before = tools_digest(names)
    assert tools_digest(names) == before

    def another(self: object) -> str:
        return f"{self}!"

    monkeypatch.setattr(kernel_compiler.KernelDispatcher, "get_overload", another)
    assert tools_digest(names) != before
    monkeypatch.undo()
    monkeypatch.setattr("perception.kernel_digest.config.BOUNDSCHECK", 1)
    assert tools_digest(names) != before


@pytest.mark.parametrize("value", ["[1.0]", "{1: 2}", "object()", "type('T', (), {'__module__': 'ours'})"])
def test_a_value_that_no_digest_covers_is_an_error(value: str) -> None:
    with pytest.raises(TypeError, match=r"a_file\.inner uses LIMIT, a"):
        digest(changed("LIMIT = 2.5", f"LIMIT = {value}"))


CALLS: Final = """
import numpy as np
from kernels_of_test import outer
print(outer(np.ones(1)), sum(outer._cache_hits.values()))
"""


def test_a_copy_loads_what_another_compiled_and_an_edit_compiles_anew(tmp_path: Path) -> None:
    def run(folder: str, source: str) -> list[str]:
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / "kernels_of_test.py").write_text(source)
        environment = {**child_environment(), "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
        environment["PYTHONDONTWRITEBYTECODE"] = "1"  # that of a source edited within a second would be taken for new
        environment["PYTHONPATH"] += f":{tmp_path / folder}"
        command = [sys.executable, "-c", CALLS]
        return subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout.split()

    assert run("first", SOURCE) == ["8.5", "0"]
    assert run("copy", changed("OTHER = 7", "OTHER = 8")) == ["8.5", "1"]
    assert run("copy", changed("LIMIT = 2.5", "LIMIT = 3.5")) == ["9.5", "0"], "a constant of what it calls"
    assert run("first", SOURCE) == ["8.5", "1"]


@pytest.mark.soak
def test_a_program_that_names_no_folder_leaves_no_kernels_where_it_runs(tmp_path: Path) -> None:
    """Not in the folder it runs in: beside the sources, or in the user's cache."""
    (tmp_path / "kernels_of_test.py").write_text(SOURCE)
    environment = {**child_environment(), "HOME": str(tmp_path / "home")}
    environment.pop("NUMBA_CACHE_DIR", None)
    environment["PYTHONPATH"] += f":{tmp_path}"
    command = [sys.executable, "-c", CALLS]
    subprocess.run(command, env=environment, cwd=tmp_path, check=True, capture_output=True)
    assert list(tmp_path.glob("*.nbc")) == []
    again = subprocess.run(command, env=environment, cwd=tmp_path, check=True, capture_output=True, text=True)
    assert again.stdout.split() == ["8.5", "1"]


def test_no_code_that_digests_cover_has_probes_of_line_coverage() -> None:
    """Else a run that measures lines would find no kernel in the cache, and compile all of them."""
    measured = MeasuredFiles(with_kernels=False)
    assert measured.matches(kernel_digest.__file__)
    assert not measured.matches(kernel_compiler.__file__)
    assert not measured.matches(refine.__file__)

"""Another value for one tuned number of perception, in this process, with the kernels that depend on it.

The number is replaced in the source as it is imported, so what is computed from it follows. Kernels hold the numbers
that they name as constants, and the cache knows nothing of that: those whose numbers differ from the shipped ones,
and those that call them, are compiled anew and not kept.
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from hashlib import sha256
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from runtime.support.kernel_cache import PACKAGES

Value: TypeAlias = int | float
Digests: TypeAlias = dict[str, str]
"""What each kernel is compiled from, by its name, the functions that it calls included."""

FACTORS: Final = (0.7, 1.4)
"""By which a number is multiplied."""
COUNT_MAX: Final = 4
"""A whole number up to this is changed by 1."""


class TunedNumber(NamedTuple):
    """A number at the top of a module.

    Attributes
    ----------
    module, name
        Where it stands.
    value
        Its shipped value.
    """

    module: str
    name: str
    value: Value

    def variants(self) -> tuple[Value, ...]:
        """Return the other values that are tried."""
        if isinstance(self.value, int):
            if abs(self.value) <= COUNT_MAX:
                return (self.value - 1, self.value + 1)
            return tuple(round(factor * self.value) for factor in FACTORS)
        return tuple(factor * self.value for factor in FACTORS)


def tuned_numbers(package: str) -> Iterator[TunedNumber]:
    """Yield the numbers at the top of a package's modules; names that only repeat another one's are left out."""
    root = importlib.import_module(package)
    for info in pkgutil.walk_packages(root.__path__, f"{package}."):
        spec = find_spec(info.name)
        if info.ispkg or spec is None or spec.origin is None:
            continue
        module = importlib.import_module(info.name)
        for name in _assigned(ast.parse(Path(spec.origin).read_text("utf-8"))):
            value = getattr(module, name)
            if isinstance(value, int | float) and not isinstance(value, bool):
                yield TunedNumber(info.name, name, value)


def _assigned(tree: ast.Module) -> Iterator[str]:
    """Yield the names that are assigned something other than a name."""
    for statement in tree.body:
        if not isinstance(statement, ast.AnnAssign) or not isinstance(statement.target, ast.Name):
            continue
        if not isinstance(statement.value, ast.Name | ast.Attribute | None):
            yield statement.target.id


class _Replace(ast.NodeTransformer):
    def __init__(self, name: str, value: Value) -> None:
        self._name, self._value = name, value

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        if isinstance(node.target, ast.Name) and node.target.id == self._name:
            node.value = ast.copy_location(ast.Constant(self._value), node)
        return node


class _Loader(SourceFileLoader):
    def __init__(self, fullname: str, path: str, number: TunedNumber) -> None:
        super().__init__(fullname, path)
        self._number = number

    def get_code(self, fullname: str) -> CodeType:
        """Compile the source with the other value, whatever is compiled in the cache."""
        tree = ast.parse(self.get_data(self.get_filename(fullname)))
        changed = _Replace(self._number.name, self._number.value).visit(tree)
        return compile(ast.fix_missing_locations(changed), self.path, "exec", dont_inherit=True)


class _Finder(MetaPathFinder):
    def __init__(self, number: TunedNumber) -> None:
        self._number = number

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the changed module's own specification, with the loader that changes it."""
        if fullname != self._number.module:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.origin is not None:
            spec.loader = _Loader(fullname, spec.origin, self._number)
        return spec


def vary(number: TunedNumber) -> None:
    """Give a number the value that `number` holds; its module must not be imported yet.

    Raises
    ------
    RuntimeError
        The module is imported already.
    """
    if number.module in sys.modules:
        raise RuntimeError(f"{number.module} is imported already, so {number.name} cannot be changed any more")
    sys.meta_path.insert(0, _Finder(number))


def kernel_digests() -> Digests:
    """Import all kernels, and return what each of them is compiled from."""
    for package in PACKAGES:
        for info in pkgutil.iter_modules(importlib.import_module(package).__path__, f"{package}."):
            importlib.import_module(info.name)
    digests: Digests = {}
    for kernel in _kernels().values():
        _digest(kernel, digests)
    return digests


def renew_kernels(shipped: Digests) -> None:
    """Compile those kernels anew whose numbers differ from the shipped ones, and do not keep them."""
    from numba.core.caching import NullCache

    found = kernel_digests()
    for name, kernel in _kernels().items():
        if found[name] != shipped.get(name):
            kernel._cache = NullCache()


def _kernels() -> Mapping[str, Any]:
    from perception.kernel_compiler import KernelDispatcher

    modules = [module for _, module in sorted(sys.modules.items()) if module is not None]
    found = (value for module in modules for value in vars(module).values() if isinstance(value, KernelDispatcher))
    return {_name(kernel): kernel for kernel in found}


def _name(kernel: Any) -> str:
    return f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}"


def _digest(kernel: Any, digests: Digests) -> str:
    """Return the text of what a kernel is compiled from, and enter it and those of the kernels that it calls."""
    name = _name(kernel)
    if name not in digests:
        digests[name] = ""  # no kernel calls itself
        names = sorted(set(kernel.py_func.__code__.co_names))
        values = kernel.py_func.__globals__
        digests[name] = repr([(one, _text(values[one], digests)) for one in names if one in values])
    return digests[name]


def _text(value: object, digests: Digests) -> str:
    if isinstance(value, int | float | str | tuple | np.generic | np.dtype):
        return repr(value)
    if isinstance(value, np.ndarray):
        return repr(value.tolist())
    if hasattr(value, "py_func"):
        return sha256(_digest(value, digests).encode()).hexdigest()
    return type(value).__name__

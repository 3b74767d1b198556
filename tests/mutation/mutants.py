"""Mutants of a module: its source with one small change. A change that no test detects is not tested.

Unlike mutmut, it also changes module-level code and decorated functions, and leaves prose alone.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass

SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Add: ast.Sub, ast.Sub: ast.Add,
    ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult, ast.Pow: ast.Mult,
    ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
    ast.And: ast.Or, ast.Or: ast.And, ast.Break: ast.Continue, ast.Continue: ast.Break,
}  # fmt: skip
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any", "floor": "ceil", "ceil": "floor", "sin": "cos",
         "cos": "sin"}  # fmt: skip
WORD_MAX = 12
"""Longest string that is changed; longer strings, and those of several words, are prose."""


@dataclass(frozen=True)
class Mutant:
    """Module with one change."""

    where: str
    """Class and function, then the number among equal changes there; it does not depend on line numbers."""
    line: int
    before: str
    after: str
    module: ast.Module
    number: int
    variant: int

    @property
    def source(self) -> str:
        """Source of the whole module with the change."""
        changed = copy.deepcopy(self.module)
        target = next(node for k, (node, _) in enumerate(_places(changed, ())) if k == self.number)
        _replace(changed, target, list(_variants(target))[self.variant])
        return ast.unparse(ast.fix_missing_locations(changed))

    @property
    def key(self) -> str:
        """Identifier of the mutant within its module."""
        return f"{self.where}: {self.before} → {self.after}"


def mutants(source: str) -> Iterator[Mutant]:
    """Yield every mutant of a module."""
    tree = ast.parse(source)
    counts: dict[str, int] = {}
    for number, (node, where) in enumerate(_places(tree, ())):
        for variant, after in enumerate(_variants(node)):
            before_text, after_text = _shown(node), _shown(after)
            name = f"{'.'.join(where) or 'module'}: {before_text} → {after_text}"
            counts[name] = counts.get(name, 0) + 1
            suffix = f" #{counts[name]}" if counts[name] > 1 else ""
            line = int(getattr(node, "lineno", 0))
            yield Mutant(
                ".".join(where) + suffix if where else "module" + suffix, line, before_text, after_text,
                tree, number, variant,
            )  # fmt: skip


def _places(node: ast.AST, where: tuple[str, ...]) -> Iterator[tuple[ast.AST, tuple[str, ...]]]:
    """Yield the nodes that may be changed, with their class and function; types and prose are left out."""
    inner = (*where, node.name) if isinstance(node, ast.ClassDef | ast.FunctionDef) else where
    yield node, inner
    for name, value in ast.iter_fields(node):
        if name in {"annotation", "returns", "decorator_list", "bases"} or isinstance(node, ast.JoinedStr):
            continue
        if isinstance(node, ast.Raise) or (isinstance(node, ast.AnnAssign) and _is_alias(node)):
            continue
        for child in value if isinstance(value, list) else [value]:
            is_text = isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant)
            if isinstance(child, ast.AST) and not is_text and not isinstance(child, ast.Import | ast.ImportFrom):
                yield from _places(child, inner)


def _is_alias(node: ast.AnnAssign) -> bool:
    return isinstance(node.annotation, ast.Name) and node.annotation.id == "TypeAlias"


def _variants(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the replacements of a node."""
    match node:
        case ast.Compare(ops=[op]) if type(op) in SWAPS:
            yield _with(node, ops=[SWAPS[type(op)]()])
        case ast.Compare(ops=[first, second]):
            yield _with(node, ops=[SWAPS[type(first)](), second])
            yield _with(node, ops=[first, SWAPS[type(second)]()])
        case ast.BinOp(op=op) | ast.BoolOp(op=op) | ast.AugAssign(op=op) if type(op) in SWAPS:
            yield _with(node, op=SWAPS[type(op)]())
        case ast.Break() | ast.Continue():
            yield SWAPS[type(node)]()
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield operand
        case ast.Constant(value=bool(value)):
            yield ast.Constant(value=not value)
        case ast.Constant(value=int(value) | float(value)):
            yield ast.Constant(value=value + 1)
        case ast.Constant(value=str(value)) if value and len(value) <= WORD_MAX and " " not in value:
            yield ast.Constant(value="X" + value)
        case ast.Constant(value=bytes(value)):
            yield ast.Constant(value=value + b"X")
        case ast.If(test=test) | ast.IfExp(test=test) | ast.While(test=test):
            yield _with(node, test=ast.UnaryOp(op=ast.Not(), operand=test))
        case ast.Return(value=ast.AST() as value) if not (isinstance(value, ast.Constant) and value.value is None):
            yield ast.Return(value=ast.Constant(value=None))
        case ast.Expr(value=ast.Call()) | ast.Raise():
            yield ast.Pass()
        case ast.Assign(targets=[ast.Attribute() | ast.Subscript()]) | ast.AnnAssign(target=ast.Attribute()):
            yield ast.Pass()
        case ast.Name(id=name) if name in NAMES:
            yield ast.Name(id=NAMES[name], ctx=ast.Load())
        case ast.Attribute(attr=name) if name in NAMES:
            yield _with(node, attr=NAMES[name])


def _with(node: ast.AST, **fields: object) -> ast.AST:
    changed = copy.copy(node)
    for name, value in fields.items():
        setattr(changed, name, value)
    return changed


def _replace(tree: ast.AST, old: ast.AST, new: ast.AST) -> None:
    for parent in ast.walk(tree):
        for name, value in ast.iter_fields(parent):
            if value is old:
                setattr(parent, name, new)
                return
            if isinstance(value, list):
                for k, child in enumerate(value):
                    if child is old:
                        value[k] = new
                        return


def _shown(node: ast.AST) -> str:
    """Return a node as text for the page: of an `if` or `while` only the condition."""
    head: ast.AST = node.test if isinstance(node, ast.If | ast.While) else node
    text = " ".join(ast.unparse(ast.fix_missing_locations(copy.deepcopy(head))).split())
    return text if len(text) <= 100 else text[:99] + "…"

"""Records with named fields that compiled kernels read and write: numpy structured arrays, declared as classes.

A subclass of `Record` declares each field once; both the array's dtype and the type checker's view come from it. A
field is a number of 8 bytes, a record, or a fixed number of either. Kernels take arrays of records, not single ones,
because an array is handed to compiled code a hundred times faster. Without a compiler (`NUMBA_DISABLE_JIT=1`) a list
of light objects on the same memory stands in for each array; numpy's own records would be twenty times slower.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from typing import (
    Annotated,
    Any,
    ClassVar,
    Final,
    Protocol,
    TypeAlias,
    TypeVar,
    cast,
    get_args,
    get_origin,
    get_type_hints,
    overload,
)

import numba
import numpy as np
from numpy.typing import NDArray

from perception.bounds import Bound, Fields, relaxed

T_co = TypeVar("T_co", covariant=True)
R = TypeVar("R", bound="Record")

INTERPRETED: Final = bool(cast("Any", numba).config.DISABLE_JIT)
"""Whether kernels run as plain Python."""
ITEM_BYTES: Final = 8
"""Size of every number in a record, so that no record is padded."""
Structured: TypeAlias = Any
"""A structured array. As `NDArray[Any]` nothing is known of its fields either, but a type checker tries all overloads
of each operator between two of them, which takes .2 s an operator, and more where one stands in another."""


class Records(Protocol[T_co]):
    """A one-dimensional array of records: an item is a reference, through which its fields are read and written."""

    @overload
    def __getitem__(self, index: int, /) -> T_co: ...
    @overload
    def __getitem__(self, index: slice, /) -> Records[T_co]: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[T_co]: ...


class Record:
    """Base of the declarations.

    A field is annotated `float`, `int`, another record's class, or `Annotated[Records[Other], n]`,
    `Annotated[Floats, n, m]`, `Annotated[Ints, n]` for arrays of a fixed shape. A number that is remembered from one
    cycle to the next also has a bound in its annotation: `Annotated[int, FLAG]`, `Annotated[Floats, n, FINITE]`, or
    one of the short forms of `perception.bounds`.
    """

    DTYPE: ClassVar[np.dtype[Any]]
    """The fields in the order in which they are declared, those of the base class first."""
    BOUNDS: ClassVar[Mapping[str, Bound | Fields]]
    """The fields' bounds; fields that are overwritten before each use may be missing."""
    _VIEW: ClassVar[type]

    def __init_subclass__(cls) -> None:
        """Derive the dtype from the annotations."""
        bases = [base for base in reversed(cls.__mro__) if issubclass(base, Record) and base is not Record]
        texts = [(name, text, base.__module__) for base in bases for name, text in base.__annotations__.items()]
        declared = {name: _evaluated(text, module) for name, text, module in texts}
        bounds = {name: _bound(hint) for name, hint in declared.items()}
        fields = {name: _without_bound(hint) for name, hint in declared.items()}
        cls.BOUNDS = {name: bound for name, bound in bounds.items() if bound is not None}
        cls.DTYPE = np.dtype((np.record, [(name, *_dtype(hint)) for name, hint in fields.items()]))
        cls._VIEW = _view_class(cls.__name__, fields, cls.DTYPE)


def zeros(record: type[R], count: int) -> Structured:
    """Return an array of `count` records, all zero, as numpy's functions take it."""
    return np.zeros(count, record.DTYPE)


def records(record: type[R], array: NDArray[Any]) -> Records[R]:
    """Return an array of records as kernels take it; both share their memory."""
    if INTERPRETED:
        return cast("Records[R]", _RecordList(record, array))
    return cast("Records[R]", array)


def array_of(of: Records[Any]) -> Structured:
    """Return the array that `records` was made from."""
    return of.array if isinstance(of, _RecordList) else of


def column(of: Records[Any], name: str) -> Structured:
    """Return one field of all records as a view, whose first axis is the record; `of` comes from `records`."""
    return array_of(of)[name]


@functools.cache
def _evaluated(text: str, module: str) -> Any:  # noqa: ANN401 - an annotation may be anything
    """Return the meaning of an annotation; most stand at many fields, and each takes a tenth of a millisecond."""
    field = type("Field", (), {"__annotations__": {"it": text}, "__module__": module})
    return get_type_hints(field, include_extras=True)["it"]


def _bound(hint: Any) -> Bound | Fields | None:  # noqa: ANN401 - an annotation may be anything
    """Return the bound of a field, or those of the fields of a record."""
    kind, *details = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    item = get_args(kind)[0] if get_origin(kind) is Records else kind
    bound = next((detail for detail in details if isinstance(detail, Bound)), None)
    if isinstance(item, type) and issubclass(item, Record):
        return item.BOUNDS if bound is None else relaxed(item.BOUNDS)
    return bound


def _without_bound(hint: Any) -> Any:  # noqa: ANN401 - an annotation may be anything
    """Return an annotation without its bound: the kind of a field, and its shape."""
    if get_origin(hint) is not Annotated:
        return hint
    kind, *details = get_args(hint)
    shape = tuple(detail for detail in details if not isinstance(detail, Bound))
    return Annotated[(kind, *shape)] if shape else kind


def _dtype(hint: Any) -> tuple[Any, ...]:  # noqa: ANN401 - an annotation may be anything
    """Return what numpy needs to know of a field: its dtype and, of an array, its shape."""
    if get_origin(hint) is Annotated:
        kind, *shape = get_args(hint)
        return _item(kind), tuple(shape)
    return (_item(hint),)


def _item(hint: Any) -> Any:  # noqa: ANN401 - an annotation may be anything
    """Return the dtype of a number, of a record, or of an array's items."""
    if hint is float or hint is int:
        return np.dtype(np.float64 if hint is float else np.int64)
    if isinstance(hint, type) and issubclass(hint, Record):
        return hint.DTYPE
    if get_origin(hint) is Records:
        return get_args(hint)[0].DTYPE
    while inner := get_args(hint):  # of an NDArray, which numpy spells in several ways
        hint = inner[-1]
    return np.dtype(hint)


class _RecordList(list[Any]):
    """The records of an array as objects, for kernels that are not compiled."""

    def __init__(self, record: type[Record], array: NDArray[Any]) -> None:
        self.array = array
        raw = memoryview(cast("Any", array.view(np.uint8).reshape(-1)))
        size = record.DTYPE.itemsize // ITEM_BYTES
        super().__init__(_views(record, raw, 0, len(array), size))


def _views(record: type[Record], raw: memoryview, begin: int, count: int, size: int) -> list[Any]:
    floats, ints, view = raw.cast("d"), raw.cast("q"), record._VIEW
    ends = range(begin, begin + size * (count + 1), size)
    return [view(raw, at, floats[at : at + size], ints[at : at + size]) for at in ends[:-1]]


class _View:
    """Base of the stand-ins for a record."""

    __slots__ = ("_at", "_floats", "_ints", "_parts", "_raw")

    def __init__(self, raw: memoryview, at: int, floats: memoryview, ints: memoryview) -> None:
        self._raw, self._at, self._floats, self._ints = raw, at, floats, ints
        self._parts: dict[str, Any] = {}


def _view_class(name: str, fields: dict[str, Any], dtype: np.dtype[Any]) -> type:
    """Return the class of a record's stand-in, which makes arrays and inner records at their first use.

    Parameters
    ----------
    name : str
        The record's.
    fields : dict of str
        Annotations by field.
    dtype : dtype
        The record's, for the places of the fields.
    """
    members: dict[str, Any] = {"__slots__": ()}
    for field, hint in fields.items():
        at = cast("Any", dtype.fields)[field][1] // ITEM_BYTES
        if hint is float:
            members[field] = _number("_floats", at)
        elif hint is int:
            members[field] = _number("_ints", at)
        else:
            members[field] = _part(field, hint, at)
    return type(f"{name}View", (_View,), members)


def _number(of: str, at: int) -> property:
    """Return the property of a number, of the stand-in's floats or of its ints."""
    if of == "_floats":
        return property(lambda self: self._floats[at], lambda self, v: self._floats.__setitem__(at, v))
    return property(lambda self: self._ints[at], lambda self, v: self._ints.__setitem__(at, v))


def _part(field: str, hint: Any, at: int) -> property:  # noqa: ANN401 - an annotation may be anything
    """Return the property of an array or of a record within one."""
    dtype, *shapes = _dtype(hint)
    shape = shapes[0] if shapes else (1,)
    record = get_args(hint)[0] if shapes else hint
    inner = get_args(record)[0] if get_origin(record) is Records else record
    is_array = not (isinstance(inner, type) and issubclass(inner, Record))

    def make(self: Any) -> Any:  # noqa: ANN401 - a record's stand-in
        begin = self._at + at
        if is_array:
            count = int(np.prod(shape))
            return np.frombuffer(self._raw, dtype, count, begin * ITEM_BYTES).reshape(shape)
        found = _views(inner, self._raw, begin, shape[0], inner.DTYPE.itemsize // ITEM_BYTES)
        return found if shapes else found[0]

    def read(self: Any) -> Any:  # noqa: ANN401 - a record's stand-in
        parts = self._parts
        if field not in parts:
            parts[field] = make(self)
        return parts[field]

    return property(read)

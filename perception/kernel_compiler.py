"""Compile kernels in about half of the time that numba takes by itself.

Numba compiles every function as if Python called it: with a wrapper, machine code and a file in the cache of its own.
Most kernels are called by kernels only. Those are kept as LLVM's intermediate code, linked into each caller, and
optimised there. Numba also resolves each operation again in every pass of its type inference, compares forty options
each time, and looks for closures, generators, `with` and parallel loops, which no kernel has.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

import numpy as np
from llvmlite.binding import Linkage, parse_assembly
from numba.core import compiler, config, errors, event, sigutils, typed_passes, types, typing, untyped_passes
from numba.core.caching import (
    IndexDataCacheFile,
    InTreeCacheLocator,
    UserProvidedCacheLocator,
    UserWideCacheLocator,
)
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_machinery import PassManager
from numba.core.cpu import CPUContext
from numba.core.dispatcher import _FunctionCompiler
from numba.core.registry import CPUDispatcher, cpu_target
from numba.np.numpy_support import from_struct_dtype, map_layout

from perception.kernel_digest import KernelDigests, tools_digest

Untyped = Any
"""What numba gives no types to."""

Args = tuple[Untyped, ...]
"""Numba's types of the arguments of a call."""

NAME_DIGITS: Final = 32
"""Hexadecimal digits of a kernel's digest in the name of its file."""

_unliteral: Final[Callable[[object], object]] = types.unliteral

_PASSES: Final = (
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    untyped_passes.IRProcessing,
    untyped_passes.GenericRewrites,
    untyped_passes.ReconstructSSA,
    typed_passes.NopythonTypeInference,
    typed_passes.PreLowerStripPhis,
    typed_passes.IRLegalization,
    typed_passes.NativeLowering,
    typed_passes.NoPythonBackend,
)
"""Those of numba's passes that change a function of loops and branches on scalars, arrays and records."""


class _Passes(PassManager):  # type: ignore[misc]  # numba has no types
    """Runs the passes; numba's own describes and checks each one, which takes a tenth of the time."""

    def _runPass(self, _index: int, each: Untyped, state: Untyped) -> None:  # noqa: N802 - numba's name
        each.analysis = self._analysis
        for step in (each.run_initialization, each.run_pass, each.run_finalizer):
            step(state)


class _Pipeline(compiler.CompilerBase):  # type: ignore[misc]  # numba has no types
    def define_pipelines(self) -> list[PassManager]:
        passes = _Passes("kernel")
        for each in _PASSES:
            passes.add_pass(each, each.__name__)
        passes.finalize()
        return [passes]


class _Options(compiler.Flags):  # type: ignore[misc]  # numba has no types
    """Compared by what was set; numba's own compares all options, at every operation that it resolves."""

    __slots__ = ()

    def __hash__(self) -> int:
        return hash(frozenset(self._values))  # some values have none

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Options) and self._values == other._values


class _TypingContext(typing.Context):  # type: ignore[misc]  # numba has no types
    """Numba's own context, which resolves the same operation on the same types once."""

    def __init__(self) -> None:
        self.__dict__.update(vars(cpu_target.typing_context))
        self._resolved: dict[Args, Untyped] = {}

    def resolve_function_type(self, func: Untyped, args: Args, kws: Untyped) -> Untyped:
        if not isinstance(func, types.Type):  # an operation on a constant: equal constants may differ in type
            return super().resolve_function_type(func, args, kws)
        key = (func, args, tuple(kws.items()))
        resolved = self._resolved.get(key)
        if resolved is None:
            resolved = super().resolve_function_type(func, args, kws)
            self._resolved[key] = resolved
        return resolved


@functools.cache
def _typing_context() -> _TypingContext:
    return _TypingContext()


class _Operation(types.Function):  # type: ignore[misc]  # numba has no types
    """An operator, which is resolved once for the same types; numba does so up to four times at each use."""

    def __init__(self, templates: Untyped) -> None:
        super().__init__(templates)
        self._resolved: dict[Args, Untyped] = {}

    def get_call_type(self, context: Untyped, args: Args, kws: Untyped) -> Untyped:
        key = (args, tuple(kws.items()))
        if key not in self._resolved:
            try:
                self._resolved[key] = super().get_call_type(context, args, kws)
            except errors.TypingError:
                self._resolved[key] = None
        if self._resolved[key] is None:
            raise errors.TypingError(self.name)
        return self._resolved[key]


class _LoweringContext(_TypingContext):
    """What code is made with after all types are known."""

    def __init__(self) -> None:
        super().__init__()
        self._operations: dict[Untyped, _Operation] = {}

    def resolve_value_type(self, val: Untyped) -> Untyped:
        kind = super().resolve_value_type(val)
        if type(kind) is not types.Function:
            return kind
        if kind not in self._operations:
            self._operations[kind] = _Operation(kind.templates)
            self._operations[kind]._impl_keys = kind._impl_keys  # of the types that it was already resolved for
        return self._operations[kind]


class _TargetContext(CPUContext):  # type: ignore[misc]  # numba has no types
    """Numba's own context, which looks once for what is not defined for some types.

    Numba asks at each access to an array whether the array is really another object, and at each access by a constant
    whether there is special code for it. Each time that there is none, it looks for new definitions, and writes the
    types of all fields into an error that it expects.
    """

    def __init__(self) -> None:
        self.__dict__.update(vars(cpu_target.target_context))
        self.typing_context = _LoweringContext()
        self._undefined: set[Args] = set()

    def get_function(self, fn: Untyped, sig: Untyped, _firstcall: bool = True) -> Untyped:
        key = (fn, sig.as_function().args)
        if key in self._undefined:
            raise NotImplementedError(fn)
        try:
            return super().get_function(fn, sig, _firstcall)
        except NotImplementedError:
            self._undefined.add(key)
            raise

    def _compile_subroutine_no_cache(self, *args: Untyped, **kws: Untyped) -> Untyped:
        """Compile a function of numba's own with its own types, to which `_Operation` does not belong."""
        context = self.subtarget(typing_context=cpu_target.typing_context)
        return super(_TargetContext, context)._compile_subroutine_no_cache(*args, **kws)


@functools.cache
def _target_context() -> _TargetContext:
    return _TargetContext()


class _InnerLibrary(JITCodeLibrary):  # type: ignore[misc]  # numba has no types
    """The code of a kernel for its callers: it is linked, and never run by itself."""

    def finalize(self) -> None:
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = "linkonce_odr"
        self._shared_module = self._final_module
        self._finalized = True


class _Compiler(_FunctionCompiler):  # type: ignore[misc]  # numba has no types
    """Compiles a kernel for Python or for other kernels."""

    def _compile_core(self, args: Args, return_type: Untyped, *, inner: bool = False) -> Untyped:
        options = _Options()
        self.targetdescr.options.parse_as_flags(options, self.targetoptions)
        if inner:
            options.no_cpython_wrapper = options.no_cfunc_wrapper = options.no_compile = True
        compiled = compiler.compile_extra(
            _typing_context(),
            _target_context(),
            self.py_func,
            args=args,
            return_type=return_type,
            flags=options,
            locals=self.locals,
            pipeline_class=_Pipeline,
        )
        if compiled.typing_error is not None:
            raise compiled.typing_error
        return compiled

    def compile_inner(self, args: Args) -> tuple[object, Untyped]:
        """Compile for other kernels; return the key by which callers find the code, and the signature."""
        compiled = self._compile_core(args, None, inner=True)
        compiled.library.__class__ = _InnerLibrary
        key = object()
        _target_context().insert_user_function(key, compiled.fndesc, [compiled.library])
        return key, compiled.signature


@functools.cache
def _digests() -> KernelDigests:
    return KernelDigests(tools_digest(globals()))


class _KernelCache:
    """The files of a kernel, one for each type of its arguments, named by the digest of what it is made of.

    Parameters
    ----------
    kernel : KernelDispatcher
        The kernel.
    allocates : bool
        Whether it allocates. Then numba first loads everything that compiling needs, its allocator among it, which
        takes a fifth of a second.
    """

    def __init__(self, kernel: KernelDispatcher, *, allocates: bool) -> None:
        self._kernel = kernel
        self._allocates = allocates

    def load_overload(self, sig: Untyped, target_context: Untyped) -> Untyped:
        """Return the compiled code for a signature, None if it is not there."""
        if self._allocates:
            target_context.refresh()
        try:
            data = _files()._load_data(self._name(sig, target_context))
        except FileNotFoundError:
            return None
        called, engine = data[1], target_context.codegen()._engine
        # Numba calls no code of which it has not seen the name, and ends the process for a name without code.
        names = {called.llvm_func_name, called.llvm_cpython_wrapper_name} - engine._defined_symbols
        engine._defined_symbols |= names
        try:
            return compiler.CompileResult._rebuild(target_context, *data)
        except BaseException:
            engine._defined_symbols -= names
            raise

    def save_overload(self, sig: Untyped, compiled: Untyped) -> None:
        """Keep the compiled code for a signature."""
        if not compiled.library.has_dynamic_globals:
            _Folder().ensure_cache_path()
            (name, kind, (machine_code, _)), *rest = compiled._reduce()
            # No intermediate code: no kernel links one that was loaded, and to read it takes half of the loading.
            kept = (name, kind, (machine_code, parse_assembly("").as_bitcode()))
            _files()._save_data(self._name(sig, compiled.target_context), (kept, *rest))

    def _name(self, sig: Untyped, target_context: Untyped) -> str:
        args, _ = sigutils.normalize_signature(sig)
        tuples = "".join(map(_named_tuples, args))
        digest = _digests().of(self._kernel, f"{_processor(target_context.codegen())} {args}{tuples}")
        return f"{self._kernel.__module__}.{self._kernel.__name__}-{digest[:NAME_DIGITS]}.nbc"


def _named_tuples(kind: Untyped) -> str:
    """Return the place and the fields of each named tuple in a type: numba's name of it has neither."""
    parts = "".join(map(_named_tuples, kind)) if isinstance(kind, types.BaseTuple) else ""
    if not isinstance(kind, types.BaseNamedTuple):
        return parts
    made = kind.instance_class
    return f" {made.__module__}.{made.__qualname__}{made._fields}{parts}"


@functools.cache
def _processor(codegen: Untyped) -> str:
    """Return what the machine code depends on: the processor; LLVM takes a while to say it."""
    return str(codegen.magic_tuple())


class _Folder(UserProvidedCacheLocator):  # type: ignore[misc]  # numba has no types
    """The folder of kernels: numba's, without its folders by the places of sources."""

    def __init__(self) -> None:
        pass

    def get_cache_path(self) -> str:
        if config.CACHE_DIR:
            return str(config.CACHE_DIR)
        # A program that uses the library names none: beside this module then, or the user's where that is read only.
        return str(next(filter(None, map(_place, (InTreeCacheLocator, UserWideCacheLocator)))).get_cache_path())


def _place(kind: Untyped) -> Untyped:
    """Return where numba would keep the code of this function, None where that cannot be written."""
    return kind.from_function(_place, __file__)


@functools.cache
def _files() -> IndexDataCacheFile:
    """Return what reads and writes files in the cache folder, each of them whole; the index of it is not used."""
    return IndexDataCacheFile(_Folder().get_cache_path(), "", "")


@functools.cache
def _record_type(dtype: np.dtype[np.void]) -> Untyped:
    """Return numba's type of a record; with records in it, that takes numba milliseconds, for each array again."""
    return from_struct_dtype(dtype)


class KernelDispatcher(CPUDispatcher):  # type: ignore[misc]  # numba has no types
    """Compiles a kernel once for each type of its arguments; numba's own does so for each constant in a call."""

    def __init__(self, function: Callable[..., object], **options: object) -> None:
        super().__init__(function, targetoptions={"nopython": True, **options}, pipeline_class=_Pipeline)
        self._compiler.__class__ = _Compiler  # a new one would look for the signature again
        self._inner: dict[Args, tuple[object, Untyped]] = {}
        self._cache = _KernelCache(self, allocates=bool(options.get("_nrt", True)))

    def typeof_pyval(self, val: object) -> Untyped:
        """Return the type of an argument."""
        if not isinstance(val, np.ndarray) or val.dtype.fields is None:
            return super().typeof_pyval(val)
        kind = types.Array(_record_type(val.dtype), val.ndim, map_layout(val), readonly=not val.flags.writeable)
        self._types_active_call.add(kind)
        return kind

    def get_call_template(self, args: Iterable[object], kws: Mapping[str, object]) -> Untyped:
        """Return what types a call by another kernel, as numba asks for it."""
        named = {name: _unliteral(kind) for name, kind in kws.items()}
        pysig, folded = self._compiler.fold_argument_types(tuple(map(_unliteral, args)), named)
        folded = tuple(folded)
        if folded not in self._inner:
            with event.trigger_event("numba:compile", {"dispatcher": self}):
                self._inner[folded] = self._compiler.compile_inner(folded)
        name, signature = self.__name__, self._inner[folded][1]
        template = typing.make_concrete_template(f"CallTemplate({name})", key=name, signatures=[signature])
        return template, pysig, folded, {}

    def get_overload(self, sig: Untyped) -> Untyped:
        """Return the key of the code that a kernel calls."""
        args, _ = sigutils.normalize_signature(sig)
        return self._inner[args][0] if args in self._inner else super().get_overload(sig)


class EntryDispatcher(KernelDispatcher):
    """Looks at the types of its arguments at the first call only: that takes four fifths of a short call."""

    _entry: Callable[..., object] | None = None

    def __call__(self, *args: object) -> object:
        """Call the compiled code."""
        if self._entry is not None:
            return self._entry(*args)
        result = super().__call__(*args)
        self._entry = next(iter(self.overloads.values())).entry_point
        return result

"""Functions that become a part of others are translated once: as that part.

numba makes machine code of each compiled function, also of one that exists inside others only, and does so again at
every level of callers. Here such a function stays intermediate code until what holds it is compiled, which takes
half the time and comes to the same.

This file and `indices.py` build on what numba does not promise to keep: to import them is an ImportError where it has
changed, and `compiled.py` goes on without. Nothing of numba's own is changed. What is different goes with the
`pipeline_class` of a function, so those of others, numba's own included, are compiled as ever, also where ours
call them.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering

from rss_shield.shield._numba.indices import AsTheyAre

_config: Any = numba.config
_njit: Any = numba.njit
_passes: Any = DefaultPassBuilder
_PassManager: Any = PassManager
_Compiler: Any = CompilerBase
_Lowering: Any = NativeLowering
_Library: Any = JITCodeLibrary
_Dispatcher: Any = CPUDispatcher

UNWRAPPED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_NEEDED = {
    AsTheyAre: "lower_getitem lower_setitem",
    _Lowering: "lowering_class run_pass",
    _Library: "codegen _optimize_functions _optimize_final_module _finalize_final_module _finalize_dynamic_globals "
    "_verify_declare_only_symbols get_pointer_to_function enable_object_caching",
    _Dispatcher: "compile get_call_template get_overload",
    _passes: "define_nopython_pipeline",
    numba.config: "OPT",
}
for _what, _names in _NEEDED.items():
    for _name in _names.split():
        if not hasattr(_what, _name):
            raise ImportError(f"numba {numba.__version__} has no {_what.__name__}.{_name}")


# ---------------------------------------------------------------- what becomes of a function

_level: list = []  # of optimisation, where it is not numba's


@contextmanager
def quickly() -> Iterator[None]:
    """Our functions are compiled at LLVM's first level of optimisation: ready sooner and, for some, as fast."""
    with global_compiler_lock:  # nobody else compiles meanwhile
        _level.append(1)
        try:
            yield
        finally:
            _level.pop()


@contextmanager
def _at_our_level() -> Iterator[None]:
    before = _config.OPT
    _config.OPT = type(before)(_level[-1]) if _level else before
    try:
        yield
    finally:
        _config.OPT = before


class _Whole(_Library):
    """Machine code."""

    def _optimize_functions(self, module: Any) -> None:
        with _at_our_level():
            super()._optimize_functions(module)

    def _optimize_final_module(self) -> None:
        with _at_our_level():
            super()._optimize_final_module()


class _OptimisedPart(_Whole):
    """Intermediate code, for callers to take in. Optimised: what takes it in compiles sooner, and runs faster."""

    @property
    def codegen(self) -> Any:
        return _NoMachine(self._codegen)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0  # there is none


class _Part(_OptimisedPart):
    """The same as it was written."""

    def _optimize_final_module(self) -> None:
        pass


class _NoMachine:
    """numba's generator of code, for what has no machine code to which an environment could be tied."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, *_: Any) -> None:
        pass


# ---------------------------------------------------------------- how it is compiled


@register_pass(mutates_CFG=True, analysis_only=False)
class _Translation(_Lowering):
    """numba's, with indices as they are and a library of our own."""

    _name = "translation_as_a_part"
    lowering_class = AsTheyAre

    def run_pass(self, state: Any) -> Any:
        if state.library is None:
            state.library = state.pipeline.library(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
        return super().run_pass(state)


class AsWhole(_Compiler):
    """How a function is compiled that has machine code."""

    library: type = _Whole

    def define_pipelines(self) -> list[Any]:
        usual = _passes.define_nopython_pipeline(self.state)
        ours = _PassManager("nopython")
        for step, text in usual.passes:
            ours.add_pass(_Translation if step is _Lowering else step, text)
        ours.finalize()
        return [ours]


class AsPart(AsWhole):
    library = _Part


class AsOptimisedPart(AsWhole):
    library = _OptimisedPart


# ---------------------------------------------------------------- functions


class Inner(_Dispatcher):
    """A function that exists inside other compiled functions only.

    What calls from Python would need (to unpack each field of each argument) makes up a good part of the
    machine code, and of the time it takes to compile.
    """

    rare = False  # LLVM keeps what leads to a call of it out of the way of what runs all the time

    def compile(self, sig: Any) -> Any:
        machine_code = super().compile(sig)
        if self.rare:
            for compiled in self.overloads.values():
                module = compiled.library._final_module
                module.get_function(compiled.fndesc.llvm_func_name).add_function_attribute("cold")
        return machine_code

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} can only be called from compiled code")


class Outer(_Dispatcher):
    """A function that Python calls as well. It has machine code where it does; for compiled callers it is a part."""

    _inside: Inner | None = None

    def _part(self) -> Inner:
        if self._inside is None:
            options = {**self.targetoptions, **UNWRAPPED}
            self._inside = Inner(self.py_func, self.locals, options, pipeline_class=AsOptimisedPart)
        return self._inside

    # what numba asks about a function when it compiles a caller

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return self._part().get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        return self._part().get_overload(sig)


def only_inside(function: Any, rare: bool = False, **options: Any) -> Any:
    """Compile a function as `Inner`. As it has no wrappers for Python, a call from there would crash."""
    dispatcher = _njit(pipeline_class=AsPart, **UNWRAPPED, **options)(function)
    dispatcher.__class__ = Inner
    dispatcher.rare = rare
    return dispatcher


def also_outside(function: Any, **options: Any) -> Any:
    """Compile a function as `Outer`."""
    dispatcher = _njit(pipeline_class=AsWhole, no_cfunc_wrapper=True, **options)(function)
    dispatcher.__class__ = Outer
    return dispatcher

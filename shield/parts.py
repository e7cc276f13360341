"""Functions that become a part of others are translated once: as that part.

numba makes machine code of each compiled function, also of one that exists inside others only, and does so again at
every level of callers. Here such a function stays intermediate code until what holds it is compiled, which takes
half the time and comes to the same.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher, cpu_target

# Options of numba. What allocates nothing needs no reference counts, which would cost more than the work itself.
PLAIN = {"_nrt": False, "error_model": "numpy"}
UNWRAPPED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
# said of every function: numba would else give it what its first compiled caller has
MERGED, APART = {"forceinline": True}, {"forceinline": False}

_Library: Any = JITCodeLibrary
_Dispatcher: Any = CPUDispatcher


class _Part(_Library):
    """Intermediate code, for callers to take in."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0  # there is none


class _OptimisedPart(_Part):
    """The same, optimised: what it becomes a part of then compiles sooner, and runs faster."""

    def _optimize_final_module(self) -> None:
        _Library._optimize_final_module(self)


@contextmanager
def _making(library: Any) -> Iterator[None]:
    """What numba compiles meanwhile goes into libraries of this kind."""
    codegen = cpu_target.target_context.codegen()
    with global_compiler_lock:
        before = codegen._library_class, codegen.set_env
        codegen._library_class = library
        codegen.set_env = lambda *_: None  # ties machine code to its module
        try:
            yield
        finally:
            codegen._library_class, codegen.set_env = before


class Inner(_Dispatcher):
    """A function that exists inside other compiled functions only.

    What calls from Python would need (to unpack each field of each argument) makes up a good part of the
    machine code, and of the time it takes to compile.
    """

    _library: type = _Part
    rare = False  # LLVM keeps what leads to a call of it out of the way of what runs all the time

    def compile(self, sig: Any) -> Any:
        with _making(self._library):
            machine_code = super().compile(sig)
        if self.rare:
            for compiled in self.overloads.values():
                module = compiled.library._final_module
                module.get_function(compiled.fndesc.llvm_func_name).add_function_attribute("cold")
        return machine_code

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} can only be called from compiled code")


class _Inside(Inner):
    """An `Outer` function as others take it in."""

    _library = _OptimisedPart


class Outer(_Dispatcher):
    """A function that Python calls as well. It has machine code where it does; for compiled callers it is a part."""

    _inside: _Inside | None = None

    def _part(self) -> _Inside:
        if self._inside is None:
            self._inside = _Inside(self.py_func, self.locals, {**self.targetoptions, **UNWRAPPED})
        return self._inside

    # what numba asks about a function when it compiles a caller

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return self._part().get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        return self._part().get_overload(sig)


def only_inside(dispatcher: Any) -> Any:
    """Make a function `Inner`. If it was compiled without wrappers for Python, a call from there would crash."""
    dispatcher.__class__ = Inner
    return dispatcher


def also_outside(dispatcher: Any) -> Any:
    """Make a function `Outer`."""
    dispatcher.__class__ = Outer
    return dispatcher

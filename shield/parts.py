"""Functions that become a part of others are translated once: as that part.

numba optimises each compiled function on its own and makes machine code of it, also of one that exists inside others
only, and does so again at every level of callers. Here such a function stays intermediate code until
what holds it is compiled, which takes a third less time and comes to the same.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher, cpu_target

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


@contextmanager
def _making(library: Any, set_env: Callable[..., None]) -> Iterator[None]:
    """What numba compiles meanwhile goes into libraries of this kind; `set_env` ties machine code to its module."""
    codegen = cpu_target.target_context.codegen()
    with global_compiler_lock:
        before = codegen._library_class, codegen.set_env
        codegen._library_class, codegen.set_env = library, set_env
        try:
            yield
        finally:
            codegen._library_class, codegen.set_env = before


class Inner(_Dispatcher):
    """A function that exists inside other compiled functions only.

    What calls from Python would need (to unpack each field of each argument) makes up a good part of the
    machine code, and of the time it takes to compile.
    """

    def compile(self, sig: Any) -> Any:
        with _making(_Part, lambda *_: None):
            return super().compile(sig)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} can only be called from compiled code")


class Outer(_Dispatcher):
    """A function that Python calls as well: it has machine code, even if an inner function was its first caller."""

    def compile(self, sig: Any) -> Any:
        codegen = cpu_target.target_context.codegen()
        with _making(JITCodeLibrary, JITCPUCodegen.set_env.__get__(codegen)):
            return super().compile(sig)


def only_inside(dispatcher: Any) -> Any:
    """Make a function `Inner`. If it was compiled without wrappers for Python, a call from there would crash."""
    dispatcher.__class__ = Inner
    return dispatcher


def also_outside(dispatcher: Any) -> Any:
    """Make a function `Outer`."""
    dispatcher.__class__ = Outer
    return dispatcher

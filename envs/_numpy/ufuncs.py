"""numpy's own transcendental functions, for compiled code.

Where a processor has AVX-512, numpy's tan, arctan, arcsin, arctan2 and power are vector functions of its
own. They differ from the C library's by a unit in the last place, which is what highway-env gets, and take a
quarter of the time. So the engine calls the very loops that `np.tan` and the others run, for many numbers
at once where it can. Elsewhere numpy's loops call the C library themselves, as its sin and cos of
doubles do everywhere.
"""

import ctypes
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from rss_shield.shield._numba.compiled import INTERPRETED

_intrinsic: Any = intrinsic
_PREFIX = "highway_shield_numpy_"


class _UFunc(ctypes.Structure):
    """`PyUFuncObject` of numpy's C interface, from behind the object's head up to what is needed here."""

    _fields_ = (
        ("inputs", ctypes.c_int),
        ("outputs", ctypes.c_int),
        ("operands", ctypes.c_int),
        ("identity", ctypes.c_int),
        ("loops", ctypes.POINTER(ctypes.c_void_p)),
        ("data", ctypes.POINTER(ctypes.c_void_p)),
        ("n_types", ctypes.c_int),
    )


def loop_of(ufunc: np.ufunc) -> tuple[int, int]:
    """Addresses of a ufunc's loop over floats and of what it is handed as its last argument, 0 = nothing."""
    record = _UFunc.from_address(id(ufunc) + object.__basicsize__)
    if (record.inputs, record.outputs, record.n_types) != (ufunc.nin, ufunc.nout, ufunc.ntypes):
        raise ImportError(f"numpy {np.__version__} keeps its functions in a way unknown here; expected numpy 2")
    row = ufunc.types.index(f"{'d' * ufunc.nin}->d")
    data = record.data[row] if record.data else None
    return record.loops[row] or 0, data or 0


def _published(ufunc: np.ufunc) -> ctypes.Array:
    """Make a ufunc's loop known to compiled code by name, so that the cache on disk holds no address."""
    cell = (ctypes.c_void_p * 2)(*loop_of(ufunc))
    llvm.add_symbol(_PREFIX + ufunc.__name__, ctypes.addressof(cell))
    return cell


_FUNCTIONS = (np.tan, np.arctan, np.arcsin, np.arctan2, np.power)
_cells = [_published(ufunc) for ufunc in _FUNCTIONS]  # referred to by the symbols


def _room(builder, kind):
    """Memory on the stack; that of `cgutils.alloca_once` would be cleared each time that a loop comes around to it."""
    with builder.goto_entry_block():
        return builder.alloca(kind)


def _kept(builder, value):
    """Memory on the stack with a value in it."""
    room = _room(builder, value.type)
    builder.store(value, room)
    return room


def _call(builder, ufunc, pointers, count):
    """Emit the call of a loop: its operands, each a pointer to `count` floats in a row, the result last."""
    byte, word = ir.IntType(8).as_pointer(), ir.IntType(64)
    module, name = builder.module, _PREFIX + ufunc.__name__
    cell = module.globals.get(name) or ir.GlobalVariable(module, ir.ArrayType(byte, 2), name)
    loop, data = (builder.load(cgutils.gep_inbounds(builder, cell, 0, i)) for i in range(2))
    operands = _room(builder, ir.ArrayType(byte, len(pointers)))
    for i, pointer in enumerate(pointers):
        builder.store(builder.bitcast(pointer, byte), cgutils.gep_inbounds(builder, operands, 0, i))
    counts = _kept(builder, count)
    strides = cgutils.global_constant(
        builder, "strides", ir.Constant(ir.ArrayType(word, len(pointers)), [8] * len(pointers))
    )
    kind = ir.FunctionType(ir.VoidType(), [byte] * 4).as_pointer()
    handed = [builder.bitcast(pointer, byte) for pointer in (operands, counts, strides)]
    builder.call(builder.bitcast(loop, kind), [*handed, data])


def _generate_one(ufunc):
    def generate(context, builder, signature, arguments):
        result = _room(builder, ir.DoubleType())
        pointers = [_kept(builder, argument) for argument in arguments]
        _call(builder, ufunc, [*pointers, result], ir.IntType(64)(1))
        return builder.load(result)

    return types.float64(*[types.float64] * ufunc.nin), generate


def _generate_each(ufunc, arrays):
    for array in arrays:
        if not isinstance(array, types.Array) or array.dtype != types.float64 or array.layout != "C":
            raise TypeError(f"{ufunc.__name__} got {array}; expected a contiguous array of float64")

    def generate(context, builder, signature, arguments):
        *operands, n = arguments
        pointers = [
            context.make_array(kind)(context, builder, value).data
            for kind, value in zip(signature.args, operands, strict=False)
        ]
        with builder.if_then(builder.icmp_signed(">", n, n.type(0))):
            _call(builder, ufunc, pointers, n)
        return context.get_dummy_value()

    return types.void(*arrays, types.int64), generate


# ---------------------------------------------------------------- of one number


def _of_one(function):
    """Where nothing is compiled, numpy's own function of the same name."""
    return getattr(np, function.__name__) if INTERPRETED else _intrinsic(function)


@_of_one
def tan(typing_context, x):
    """`np.tan` of a float."""
    return _generate_one(np.tan)


@_of_one
def arctan(typing_context, x):
    """`np.arctan` of a float."""
    return _generate_one(np.arctan)


@_of_one
def arcsin(typing_context, x):
    """`np.arcsin` of a float."""
    return _generate_one(np.arcsin)


@_of_one
def arctan2(typing_context, y, x):
    """`np.arctan2` of two floats."""
    return _generate_one(np.arctan2)


@_of_one
def power(typing_context, base, exponent):
    """`np.power` of two floats."""
    return _generate_one(np.power)


# ---------------------------------------------------------------- of the first n numbers of arrays
# The result must not be one of the arguments: numpy would take another function.


def _of_each(function):
    """Likewise, for the first n numbers."""
    if not INTERPRETED:
        return _intrinsic(function)
    ufunc = getattr(np, function.__name__.removesuffix("_each"))

    def each(*arrays_and_n):
        *arrays, n = arrays_and_n
        ufunc(*(array[:n] for array in arrays[:-1]), out=arrays[-1][:n])

    return each


@_of_each
def tan_each(typing_context, x, out, n):
    """`np.tan` of floats."""
    return _generate_each(np.tan, (x, out))


@_of_each
def arctan_each(typing_context, x, out, n):
    """`np.arctan` of floats."""
    return _generate_each(np.arctan, (x, out))


@_of_each
def arcsin_each(typing_context, x, out, n):
    """`np.arcsin` of floats."""
    return _generate_each(np.arcsin, (x, out))


@_of_each
def arctan2_each(typing_context, y, x, out, n):
    """`np.arctan2` of floats."""
    return _generate_each(np.arctan2, (y, x, out))


@_of_each
def power_each(typing_context, bases, exponents, out, n):
    """`np.power` of floats."""
    return _generate_each(np.power, (bases, exponents, out))

"""Lanes: a number of eight doubles side by side, so that one source serves one problem or eight.

A kernel written with `load`, `store` and the arithmetic below works on plain doubles where it is
called with `ONE`, and on LANES independent problems at a time where it is called with `MANY`; every
operation is then one vector instruction. Lanes never mix, and products are added with a single
rounding (`fma`) in either width: a problem gives the same result, bit for bit, alone or in any
company. A double that meets lanes, in arithmetic or in `store`, `fma`, `pick` and `larger`, stands
for itself in each of them (`same` makes lanes of it, where a sum begins). Arrays hold the lanes of
one number next to each other: shape (…, 1) or (…, LANES).

Left to the compiler, loops over lanes spend most of their time proving that arrays do not overlap:
a factorisation of 400 disks took 0.11 ms a matrix, with explicit lanes it takes 0.028 ms (16 lanes
are slower: eight factors fit into the cache and sixteen do not).
"""

import ctypes.util
import logging
import math
import operator
import os
from typing import Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import config, njit, types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

from granforce.system.compiled import skip_unreadable_indices, tell_when_compiling
from granforce.system.parts import PartCompiler
from granforce.types import Floats

skip_unreadable_indices()

LANES = 8
# Heard by those who ask for it: logging.basicConfig(level=logging.INFO).
_log = logging.getLogger("granforce")
_log.addHandler(logging.NullHandler())
tell_when_compiling(lambda: _log.info("compiling kernels, once per machine"))

# Kernels that are called from Python, and those that are called by kernels only: without what the
# former need to be called, a third of the time to compile is saved.
# Where the compiler is off (NUMBA_DISABLE_JIT) they run as they are written, slowly, with the same
# results; that numpy warns of what compiled code leaves at NaN or infinity is then switched off.
_KERNEL = {"cache": True, "nogil": True, "error_model": "numpy"}
_PART = _KERNEL | {
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": PartCompiler,
}
compiled = np.errstate(all="ignore") if config.DISABLE_JIT else njit(**_KERNEL)
within = njit(**_PART)
# What must become part of those that call it: small ones, or their numbers pass through memory, and
# whatever is called for each contact with a network, which is a hundred numbers to hand over (a
# step of one interior-point method takes 0.15 ms in place of 0.27, with the same bits).
inline = njit(**_PART, forceinline=True)

# What kernels take as their last argument: its length is known to the compiler.
# Of numpy's numbers: kernels would be compiled once more for a constant that Python's numbers are.
ONE, MANY = (np.int64(0),), (np.int64(0),) * LANES
# So few problems are faster one after the other than beside idle lanes.
_FEW = 2


# Doubles in a line of the cache.
_LINE = 8


def lanes_for(count: int) -> Any:
    """The lanes that so many waiting problems go in."""
    return MANY if count > _FEW else ONE


def room(*shape: int, value: float = 0.0) -> Floats:
    """An array of one value that begins where a line of the cache does.

    Lanes that lie across two lines take up to twice the time: a factorisation reaches 22 to 28
    Gflop/s with the arrays of numpy, which begin anywhere, and 38 to 44 so.
    """
    size = int(np.prod(shape))
    longer = np.zeros(size + _LINE - 1)
    first = -(longer.ctypes.data // longer.itemsize) % _LINE
    found = longer[first : first + size].reshape(shape)
    if value:
        found.fill(value)
    return found


def side_by_side(values: npt.ArrayLike, width: int) -> Floats:
    """Values (n,) in each of so many lanes: (n, width)."""
    values = np.asarray(values)
    found = room(len(values), width)
    found[:] = values[:, None]
    return found


_DOUBLE = ir.DoubleType()


class Lanes(types.Type):
    """Numba's type of `width` doubles side by side."""

    def __init__(self, width):
        self.width = width
        super().__init__(name=f"Lanes({width})")


@register_model(Lanes)
class _Model(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(_DOUBLE, kind.width))


def _number(lanes):
    """The type of a number in so many lanes."""
    return types.float64 if lanes.count == 1 else Lanes(lanes.count)


def _kinds(*kinds):
    """(type of what numbers of these types give together, theirs in a signature).

    A plain number beside lanes stands for itself in each of them.
    """
    own = tuple(kind if isinstance(kind, Lanes) else types.float64 for kind in kinds)
    return next((kind for kind in own if isinstance(kind, Lanes)), types.float64), own


def _alike(builder, kind, values):
    """Values as numbers of one type."""
    if not isinstance(kind, Lanes):
        return values
    return [_in_all(builder, v, kind.width) if v.type == _DOUBLE else v for v in values]


def _place(context, builder, signature, args):
    """Pointer to the lanes of one number of an array."""
    array = context.make_array(signature.args[0])(context, builder, args[0])
    width = signature.args[2].count
    kind = _DOUBLE if width == 1 else ir.VectorType(_DOUBLE, width)
    first = builder.mul(args[1], ir.Constant(ir.IntType(64), width))
    return builder.bitcast(builder.gep(array.data, [first]), kind.as_pointer())


def instruction(plain):
    """An intrinsic; `plain`, which does the same to numpy's numbers, where the compiler is off."""
    return (lambda typed: plain) if config.DISABLE_JIT else intrinsic


def _plain_load(array, index, lanes):
    if array.ndim == _SHARED:
        return _plain_same(lanes, array.reshape(-1)[index])
    found = array.reshape(-1, len(lanes))[index]
    return found[0] if len(lanes) == 1 else found.copy()


def _plain_store(array, index, lanes, value):
    array.reshape(-1, len(lanes))[index] = value


def _plain_same(lanes, value):
    return np.float64(value) if len(lanes) == 1 else np.full(len(lanes), float(value))


def _plain_pick(a, b, yes, no):
    found = np.where(a > b, yes, no)
    return found if found.ndim else found[()]


def _plain_larger(a, b):
    return _plain_pick(a, b, a, b)


def _rounded_once():
    """a b + c of doubles, rounded once: of Python (from 3.13 on), or of the C library."""
    if hasattr(math, "fma"):
        return math.fma
    library = ctypes.CDLL(ctypes.util.find_library("m" if os.name == "posix" else "ucrtbase"))
    library.fma.restype, library.fma.argtypes = ctypes.c_double, [ctypes.c_double] * 3
    return library.fma


def _plain_fma(a, b, c):
    width = max(map(np.size, (a, b, c)))
    if width == 1:
        return np.float64(_FMA(a, b, c))
    rows = np.broadcast_arrays(a, b, c)
    return np.array([_FMA(*row) for row in zip(*rows, strict=True)])


_FMA = _rounded_once() if config.DISABLE_JIT else None


# Axes of arrays whose numbers are the same in all lanes.
_SHARED = 4


def shared(values: Floats) -> Floats:
    """Values (n, 1) as numbers that `load` gives to all lanes alike."""
    return values.reshape(-1, *(1,) * (_SHARED - 1))


@instruction(_plain_load)
def load(typing, array, index, lanes):
    """Number `index` of a contiguous array, of one that is `shared` the same in all lanes."""

    def emit(context, builder, signature, args):
        if array.ndim == _SHARED and lanes.count > 1:
            first = context.make_array(array)(context, builder, args[0]).data
            return _in_all(builder, builder.load(builder.gep(first, [args[1]])), lanes.count)
        return builder.load(_place(context, builder, signature, args), align=8)

    return _number(lanes)(array, types.int64, lanes), emit


@instruction(_plain_store)
def store(typing, array, index, lanes, value):
    """Set number `index` of a contiguous array."""
    _, (given,) = _kinds(value)

    def emit(context, builder, signature, args):
        (number,) = _alike(builder, _number(lanes), args[3:])
        builder.store(number, _place(context, builder, signature, args), align=8)
        return context.get_dummy_value()

    return types.void(array, types.int64, lanes, given), emit


@instruction(_plain_same)
def same(typing, lanes, value):
    """One double in all lanes."""
    kind = _number(lanes)

    def emit(context, builder, signature, args):
        return args[1] if kind is types.float64 else _in_all(builder, args[1], kind.width)

    return kind(lanes, types.float64), emit


def _in_all(builder, value, width):
    """A vector of so many times one double."""
    index = ir.IntType(32)
    vector = ir.Constant(ir.VectorType(_DOUBLE, width), ir.Undefined)
    vector = builder.insert_element(vector, value, index(0))
    first = ir.Constant(ir.VectorType(index, width), [0] * width)
    return builder.shuffle_vector(vector, vector, first)


def _named(builder, name, args):
    """Call one of LLVM's own functions of doubles or vectors."""
    kind = args[0].type
    suffix = "f64" if kind == _DOUBLE else f"v{kind.count}f64"
    function = cgutils.get_or_insert_function(
        builder.module, ir.FunctionType(kind, [kind] * len(args)), f"{name}.{suffix}"
    )
    return builder.call(function, args)


@instruction(_plain_fma)
def fma(typing, a, b, c):
    """a b + c, rounded once."""
    kind, given = _kinds(a, b, c)

    def emit(context, builder, signature, args):
        return _named(builder, "llvm.fma", _alike(builder, kind, args))

    return kind(*given), emit


@instruction(np.sqrt)
def root(typing, a):
    """√a."""

    def emit(context, builder, signature, args):
        return _named(builder, "llvm.sqrt", args)

    return a(a), emit


@instruction(abs)
def size(typing, a):
    """|a|."""

    def emit(context, builder, signature, args):
        return _named(builder, "llvm.fabs", args)

    return a(a), emit


@instruction(lambda a: bool(np.all(a == 0.0)))
def vanishes(typing, a):
    """Whether a is 0 in every lane."""

    def emit(context, builder, signature, args):
        zero = ir.Constant(args[0].type, None)
        equal = builder.fcmp_ordered("==", args[0], zero)
        if args[0].type == _DOUBLE:
            return equal
        bits = ir.IntType(args[0].type.count)
        return builder.icmp_unsigned("==", builder.bitcast(equal, bits), ir.Constant(bits, -1))

    return types.boolean(a), emit


@instruction(_plain_pick)
def pick(typing, a, b, yes, no):
    """`yes` in the lanes where a > b, `no` in the others."""
    kind, given = _kinds(a, b, yes, no)

    def emit(context, builder, signature, args):
        one, other, first, second = _alike(builder, kind, args)
        return builder.select(builder.fcmp_ordered(">", one, other), first, second)

    return kind(*given), emit


@instruction(_plain_larger)
def larger(typing, a, b):
    """The larger of both, b where a is not a number."""
    kind, given = _kinds(a, b)

    def emit(context, builder, signature, args):
        one, other = _alike(builder, kind, args)
        return builder.select(builder.fcmp_ordered(">", one, other), one, other)

    return kind(*given), emit


def _operate(operation, instruction, count):
    """Make an operation of Lanes, or of Lanes and a number for all of them, one instruction."""

    @type_callable(operation)
    def kind(context):
        def of_two(a, b):
            if isinstance(a, Lanes):
                return a if a == b or isinstance(b, types.Float) else None
            return b if isinstance(a, types.Float) and isinstance(b, Lanes) else None

        def of_one(a):
            return a if isinstance(a, Lanes) else None

        return of_two if count == 2 else of_one

    def emit(context, builder, signature, args):
        return getattr(builder, instruction)(*_alike(builder, signature.return_type, args))

    mixed = [(Lanes, types.Float), (types.Float, Lanes)] if count == 2 else []
    for kinds in [(Lanes,) * count, *mixed]:
        lower_builtin(operation, *kinds)(emit)


for _operation, _instruction, _count in (
    (operator.add, "fadd", 2),
    (operator.sub, "fsub", 2),
    (operator.mul, "fmul", 2),
    (operator.truediv, "fdiv", 2),
    (operator.neg, "fneg", 1),
):
    _operate(_operation, _instruction, _count)

"""Lanes: a number of eight doubles side by side, so that one source handles one problem or eight.

A kernel written with `load`, `store` and the arithmetic below works on plain doubles if called with
`ONE`, and on LANES independent problems at a time if called with `MANY`; every operation is then
one vector instruction. Lanes never mix, and products are added with a single rounding (`fma`) in
either width: a problem gives bit-identical results alone or with any others. A double combined with
lanes, in arithmetic or in `store`, `fma`, `pick` and `larger`, is used in each of them (`same`
converts it to lanes, to begin a sum). Arrays hold the lanes of one number next to each other: shape
(…, 1) or (…, LANES). A problem alone computes three numbers at a time instead (`three`), or fills
the lanes with rows of its own (`gather`, `scatter`).

Without explicit lanes, the compiler's loops spend most of their time proving that arrays do not
overlap: a factorisation of 400 disks took 0.11 ms per matrix, compared with 0.028 ms in explicit
lanes (16 lanes are slower: eight factors fit into the cache, sixteen do not).
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

from granforce.system.compiled import (
    recompile_after_any_change,
    skip_unreadable_indices,
    tell_when_compiling,
)
from granforce.system.part_compiler import PartCompiler
from granforce.types import Floats

skip_unreadable_indices()
recompile_after_any_change()

LANES = 8
# To see these messages: logging.basicConfig(level=logging.INFO).
_log = logging.getLogger("granforce")
_log.addHandler(logging.NullHandler())
tell_when_compiling(lambda: _log.info("compiling kernels, once per machine"))

# Options of kernels called from Python, and of those called only by kernels, which need no wrapper
# and compile in two thirds of the time. With the compiler off (NUMBA_DISABLE_JIT) they run as
# Python, slowly, with the same results; numpy's warnings about NaN and infinity are then switched
# off.
_KERNEL = {"cache": True, "nogil": True, "error_model": "numpy"}
_PART = _KERNEL | {
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": PartCompiler,
}
# Counting references to arrays is left out: it takes a third of compiling, and only kernels that
# allocate or return arrays, and those that receive such an array from a part, need it.
_COUNTED, _UNCOUNTED = {"_nrt": True}, {"_nrt": False}
allocating = np.errstate(all="ignore") if config.DISABLE_JIT else njit(**_KERNEL, **_COUNTED)
compiled = allocating if config.DISABLE_JIT else njit(**_KERNEL, **_UNCOUNTED)
allocating_part = njit(**_PART, **_COUNTED)
within = njit(**_PART, **_UNCOUNTED)
# Inlined into their callers: small kernels, whose numbers would otherwise pass through memory, and
# kernels called for each contact with a network, which has a hundred fields to pass (a step of one
# interior-point method takes 0.15 ms instead of 0.27, with the same bits).
inline = njit(**_PART, **_UNCOUNTED, forceinline=True)

# The last argument of kernels, whose length the compiler knows. NumPy integers, because kernels
# would be compiled again for Python constants.
ONE, MANY = (np.int64(0),), (np.int64(0),) * LANES
# This few problems are faster one by one than with idle lanes.
_FEW = 2


# Doubles in a cache line.
_LINE = 8


def lanes_for(count: int) -> Any:
    """The lanes (ONE or MANY) for this many waiting problems."""
    return MANY if count > _FEW else ONE


def room(*shape: int, value: float = 0.0) -> Floats:
    """An array filled with one value that starts at a cache line.

    Lanes that straddle two cache lines take up to twice the time: a factorisation reaches 22 to 28
    Gflop/s with NumPy's arrays, which start anywhere, and 38 to 44 with these.
    """
    size = int(np.prod(shape))
    longer = np.zeros(size + _LINE - 1)
    first = -(longer.ctypes.data // longer.itemsize) % _LINE
    array = longer[first : first + size].reshape(shape)
    if value:
        array.fill(value)
    return array


def side_by_side(values: npt.ArrayLike, width: int) -> Floats:
    """Values (n,) repeated in each of `width` lanes: (n, width)."""
    values = np.asarray(values)
    array = room(len(values), width)
    array[:] = values[:, None]
    return array


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
    """The type of a number in these lanes."""
    return types.float64 if lanes.count == 1 else Lanes(lanes.count)


def _kinds(*kinds):
    """(common result type of numbers of these types, their types in a signature).

    A plain number combined with lanes is used in each of them.
    """
    typed = tuple(kind if isinstance(kind, Lanes) else types.float64 for kind in kinds)
    return next((kind for kind in typed if isinstance(kind, Lanes)), types.float64), typed


def _alike(builder, kind, values):
    """Convert values to numbers of one type."""
    if not isinstance(kind, Lanes):
        return values
    return [_in_all(builder, v, kind.width) if v.type == _DOUBLE else v for v in values]


def _place(context, builder, signature, args):
    """Pointer to the lanes of one array element."""
    array = context.make_array(signature.args[0])(context, builder, args[0])
    width = next(kind.count for kind in signature.args if isinstance(kind, types.BaseTuple))
    kind = _DOUBLE if width == 1 else ir.VectorType(_DOUBLE, width)
    first = builder.mul(args[1], ir.Constant(ir.IntType(64), width))
    return builder.bitcast(builder.gep(array.data, [first]), kind.as_pointer())


def instruction(plain):
    """Make an intrinsic; with the compiler off, `plain` does the same with NumPy's numbers."""
    return (lambda typed: plain) if config.DISABLE_JIT else intrinsic


def _plain_load(array, index, lanes):
    if array.ndim == _SHARED:
        return _plain_same(lanes, array.reshape(-1)[index])
    values = array.reshape(-1, len(lanes))[index]
    return values[0] if len(lanes) == 1 else values.copy()


def _plain_store(array, index, lanes, value):
    array.reshape(-1, len(lanes))[index] = value


def _plain_three(array, index, step, lanes):
    return np.array([_plain_load(array, index + k * step, lanes) for k in range(3)])


def _plain_keep_three(array, index, lanes, values):
    for k in range(3):
        _plain_store(array, index + k, lanes, values[k])


def _plain_less(values, a, b):
    return np.array([_plain_fma(-a, one, other) for one, other in zip(b, values, strict=True)])


def _plain_gather(array, places, first, lanes):
    rows = array[places[first : first + len(lanes)]]
    return rows[:, 0].copy(), rows[:, 1].copy(), rows[:, 2].copy()


def _plain_scatter(array, places, first, lanes, values):
    array[places[first : first + len(lanes)], :3] = np.stack(values, axis=1)


def _plain_total(a):
    while len(a) > 1:
        a = a[: len(a) // 2] + a[len(a) // 2 :]
    return a[0]


def _plain_same(lanes, value):
    return np.float64(value) if len(lanes) == 1 else np.full(len(lanes), float(value))


def _plain_pick(a, b, yes, no):
    values = np.where(a > b, yes, no)
    return values if values.ndim else values[()]


def _plain_larger(a, b):
    return _plain_pick(a, b, a, b)


def _rounded_once():
    """a b + c of doubles, rounded once, from Python (3.13 or later) or the C library."""
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


# Axes of arrays whose numbers are shared by all lanes.
_SHARED = 4


def shared(values: Floats) -> Floats:
    """Values (n, 1) that `load` gives equally to all lanes."""
    return values.reshape(-1, *(1,) * (_SHARED - 1))


@instruction(_plain_load)
def load(typing, array, index, lanes):
    """Element `index` of a contiguous array, or of a `shared` array the same in all lanes."""

    def emit(context, builder, signature, args):
        if array.ndim == _SHARED and lanes.count > 1:
            first = context.make_array(array)(context, builder, args[0]).data
            return _in_all(builder, builder.load(builder.gep(first, [args[1]])), lanes.count)
        return builder.load(_place(context, builder, signature, args), align=8)

    return _number(lanes)(array, types.int64, lanes), emit


@instruction(_plain_store)
def store(typing, array, index, lanes, value):
    """Set element `index` of a contiguous array."""
    _, (given,) = _kinds(value)

    def emit(context, builder, signature, args):
        (number,) = _alike(builder, _number(lanes), args[3:])
        builder.store(number, _place(context, builder, signature, args), align=8)
        return context.get_dummy_value()

    return types.void(array, types.int64, lanes, given), emit


@instruction(_plain_three)
def three(typing, array, index, step, lanes):
    """Elements `index`, `index + step` and `index + 2 step`, to compute with side by side."""

    def emit(context, builder, signature, args):
        places = _three_places(context, builder, signature, args[:2], args[2])
        return _joined(builder, [builder.load(place, align=8) for place in places])

    return _three_numbers(lanes)(array, types.int64, types.int64, lanes), emit


@instruction(_plain_keep_three)
def keep_three(typing, array, index, lanes, values):
    """Set three consecutive elements."""

    def emit(context, builder, signature, args):
        step = ir.Constant(ir.IntType(64), 1)
        places = _three_places(context, builder, signature, args[:2], step)
        for place, value in zip(places, _apart(builder, args[3]), strict=True):
            builder.store(value, place, align=8)
        return context.get_dummy_value()

    return types.void(array, types.int64, lanes, values), emit


@instruction(_plain_less)
def less(typing, values, a, b):
    """values − a b, rounded once, for three numbers `values` and b."""

    def emit(context, builder, signature, args):
        # Negated b, which loops keep: a is loaded into all places by the product itself.
        if args[1].type == _DOUBLE:
            a, b = _in_all(builder, args[1], 3), builder.fneg(args[2])
            return _named(builder, "llvm.fma", [a, b, args[0]])
        numbers = zip(_apart(builder, args[2]), _apart(builder, args[0]), strict=True)
        products = [
            _named(builder, "llvm.fma", [args[1], builder.fneg(b), value]) for b, value in numbers
        ]
        return _joined(builder, products)

    return values(values, a, b), emit


# Doubles in a row that `gather` loads whole: a vector of three would take two instructions.
ROW = 4


@instruction(_plain_gather)
def gather(typing, array, places, first, lanes):
    """The first three numbers of an array's rows (…, ROW), which `places` lists from `first` on."""

    def emit(context, builder, signature, args):
        rows = [builder.load(p, align=8) for p in _rows(context, builder, signature, args)]
        fours = [_transposed(builder, rows[k : k + ROW]) for k in range(0, len(rows), ROW)]
        every = list(range(lanes.count))
        numbers = [_shuffled(builder, low, high, every) for low, high in zip(*fours, strict=True)]
        return cgutils.pack_array(builder, numbers[:3])

    return types.UniTuple(_number(lanes), 3)(array, places, types.int64, lanes), emit


@instruction(_plain_scatter)
def scatter(typing, array, places, first, lanes, values):
    """Set what `gather` returns; of equal places, the last one counts."""

    def emit(context, builder, signature, args):
        places, numbers = _rows(context, builder, signature, args), _apart(builder, args[4])
        for first in range(0, len(places), ROW):
            some = list(range(first, first + ROW))
            four = [_shuffled(builder, number, number, some) for number in [*numbers, numbers[2]]]
            for place, row in zip(places[first:], _transposed(builder, four), strict=False):
                builder.store(row, place, align=8)
        return context.get_dummy_value()

    return types.void(array, places, types.int64, lanes, values), emit


def _rows(context, builder, signature, args):
    """Pointers to rows; args: the array, the places of rows, the first of them, the lanes."""
    data, places = (
        context.make_array(signature.args[k])(context, builder, args[k]).data for k in range(2)
    )
    word, row = ir.IntType(64), ir.VectorType(_DOUBLE, ROW).as_pointer()
    listed = [builder.add(args[2], word(k)) for k in range(signature.args[3].count)]
    rows = [builder.load(builder.gep(places, [place])) for place in listed]
    firsts = [builder.gep(data, [builder.mul(number, word(ROW))]) for number in rows]
    return [builder.bitcast(first, row) for first in firsts]


def _transposed(builder, rows):
    """Four vectors of four: number k of each, for every k."""
    pairs = [
        _shuffled(builder, *two, places)
        for two in (rows[:2], rows[2:])
        for places in ([0, 4, 2, 6], [1, 5, 3, 7])
    ]
    return [
        _shuffled(builder, *two, places)
        for places in ([0, 1, 4, 5], [2, 3, 6, 7])
        for two in (pairs[::2], pairs[1::2])
    ]


def _shuffled(builder, a, b, places):
    """The numbers of two vectors, counted on from a to b, at these places."""
    index = ir.IntType(32)
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(index, len(places)), places))


@instruction(_plain_total)
def total(typing, a):
    """The sum over all lanes."""

    def emit(context, builder, signature, args):
        sums, width = args[0], a.width
        while width > 1:
            width //= 2
            low, high = list(range(width)), list(range(width, 2 * width))
            halves = [_shuffled(builder, sums, sums, half) for half in (low, high)]
            sums = builder.fadd(*halves)
        return builder.extract_element(sums, ir.IntType(32)(0))

    return types.float64(a), emit


@instruction(_plain_same)
def same(typing, lanes, value):
    """One double in all lanes."""
    kind = _number(lanes)

    def emit(context, builder, signature, args):
        return args[1] if kind is types.float64 else _in_all(builder, args[1], kind.width)

    return kind(lanes, types.float64), emit


def _in_all(builder, value, width):
    """A vector that repeats one double `width` times."""
    index = ir.IntType(32)
    vector = ir.Constant(ir.VectorType(_DOUBLE, width), ir.Undefined)
    vector = builder.insert_element(vector, value, index(0))
    first = ir.Constant(ir.VectorType(index, width), [0] * width)
    return builder.shuffle_vector(vector, vector, first)


def _three_numbers(lanes):
    """The type of three numbers: one vector of doubles, or three vectors of lanes."""
    return Lanes(3) if lanes.count == 1 else types.UniTuple(Lanes(lanes.count), 3)


def _three_places(context, builder, signature, args, step):
    places = [args[1]]
    for _ in range(2):
        places.append(builder.add(places[-1], step))
    return [_place(context, builder, signature, (args[0], place)) for place in places]


def _joined(builder, numbers):
    """Three numbers as a value of their type."""
    if numbers[0].type == _DOUBLE:
        joined = ir.Constant(ir.VectorType(_DOUBLE, 3), ir.Undefined)
        for k in range(3):
            joined = builder.insert_element(joined, numbers[k], ir.IntType(32)(k))
        return joined
    return cgutils.pack_array(builder, numbers)


def _apart(builder, values):
    """The three numbers of a value."""
    if isinstance(values.type, ir.VectorType):
        return [builder.extract_element(values, ir.IntType(32)(k)) for k in range(3)]
    return cgutils.unpack_tuple(builder, values)


def _named(builder, name, args):
    """Call an LLVM intrinsic on doubles or vectors."""
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
    """The larger of both; b if a is NaN."""
    kind, given = _kinds(a, b)

    def emit(context, builder, signature, args):
        one, other = _alike(builder, kind, args)
        return builder.select(builder.fcmp_ordered(">", one, other), one, other)

    return kind(*given), emit


def _operate(operation, instruction, count):
    """Compile an operation on Lanes, or on Lanes and a number, to one instruction."""

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

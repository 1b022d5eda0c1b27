"""Vectors of cells for compiled code: one value per lane, all lanes at once.

Numba can leave vectorisation to LLVM, which gives up on long loops, and takes at most half of the
lanes of AVX-512. Here a vector is a type of its own, and each operation is one instruction for all
lanes. The results in a lane do not depend on the number of lanes.

`a * b + c` is fused where the processor can, as everywhere in the solver (`FUSED`).
"""

import operator
from collections.abc import Callable
from typing import Any, Final

from llvmlite import ir
from llvmlite.binding import get_host_cpu_features
from numba import njit, types
from numba.extending import intrinsic, models, overload, register_model

_VECTOR_BYTES: Final = 64 if get_host_cpu_features().get("avx512f", False) else 32
"""Size of a vector of this processor."""

LANES: Final = _VECTOR_BYTES // 4
"""Cells per vector in single precision, and a multiple of those in double precision."""

_CONTRACT: Final = ("contract",)
_BITS: Final[dict[types.Type, int]] = {types.float32: 32, types.float64: 64}


class Lanes(types.Type):
    """Numba's type of a vector of reals, or of truth values, of `real`'s number of lanes."""

    def __init__(self, real: types.Type, *, mask: bool = False) -> None:
        self.real, self.mask = real, mask
        self.count = lanes_of(_BITS[real] // 8)
        super().__init__(name=f"Lanes({real}, {self.count}{', mask' * mask})")


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Lanes) -> None:
        scalar = ir.IntType(1) if fe_type.mask else dmm.lookup(fe_type.real).get_value_type()
        super().__init__(dmm, fe_type, ir.VectorType(scalar, fe_type.count))  # type: ignore[no-untyped-call]


def lanes_of(item_bytes: int) -> int:
    """Return the number of lanes of reals of this size."""
    return _VECTOR_BYTES // item_bytes


_lane: Final[Callable[[Callable[..., Any]], Callable[..., Any]]] = intrinsic


@_lane
def place(_context: Any, array: Any) -> tuple[Any, Callable[..., Any]]:
    """Return the place of an array's first entry in memory; the array must outlive its use.

    Arrays count their references, by calls that empty all registers, in each inlined function.
    """

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, value=args[0]).data

    pointer = types.CPointer(array.dtype)  # type: ignore[no-untyped-call]
    return pointer(array), build


@_lane
def lanes_at(_context: Any, place: Any) -> tuple[Any, Callable[..., Any]]:
    """Return the number of lanes of a vector of entries at a place."""
    count = lanes_of(_BITS[place.dtype] // 8)
    return types.int64(place), lambda *_: ir.Constant(ir.IntType(64), count)


@_lane
def own_frame(_context: Any) -> tuple[Any, Callable[..., Any]]:
    """Give the function that is compiled a frame of its own, aligned to vectors.

    Without it, each vector that does not fit into registers straddles two lines of the cache.
    """

    def build(context: Any, builder: Any, _signature: Any, _args: Any) -> Any:
        builder.function.attributes.alignstack = _VECTOR_BYTES
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return types.void(), build


@_lane
def called_rarely(_context: Any) -> tuple[Any, Callable[..., Any]]:
    """Keep the function that is compiled apart from its callers, which favour not to call it."""

    def build(context: Any, builder: Any, _signature: Any, _args: Any) -> Any:
        builder.function.attributes.add("noinline")
        builder.function.attributes.add("cold")
        return context.get_dummy_value()

    return types.void(), build


@_lane
def rarely(_context: Any, condition: Any) -> tuple[Any, Callable[..., Any]]:
    """Return a condition, and let the compiler favour the path without it."""

    def build(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        bit = ir.IntType(1)
        function = _declared(builder, "llvm.expect.i1", bit, [bit, bit])
        return builder.call(function, [args[0], ir.Constant(bit, 0)])

    if condition != types.boolean:
        raise TypeError(f"rarely({condition})")
    return condition(condition), build


@_lane
def get(_context: Any, place: Any, index: Any) -> tuple[Any, Callable[..., Any]]:
    """Return an entry from a place in memory on, without any check."""

    def build(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.load(builder.gep(args[0], [args[1]], inbounds=True))

    return place.dtype(place, index), build


@_lane
def put(_context: Any, place: Any, index: Any, value: Any) -> tuple[Any, Callable[..., Any]]:
    """Set an entry from a place in memory on, without any check."""

    def build(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        entry = context.cast(builder, args[2], value, place.dtype)
        builder.store(entry, builder.gep(args[0], [args[1]], inbounds=True))
        return context.get_dummy_value()

    return types.void(place, index, value), build


@_lane
def load(_context: Any, place: Any, index: Any) -> tuple[Any, Callable[..., Any]]:
    """Return a vector of entries from a place in memory on, without any check."""
    lanes = Lanes(place.dtype)

    def build(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        entries = _entries(builder, args, context.get_value_type(lanes))
        return builder.load(entries, align=_BITS[place.dtype] // 8)

    return lanes(place, index), build


@_lane
def fetch(_context: Any, place: Any, index: Any) -> tuple[Any, Callable[..., Any]]:
    """Begin to load a line of the cache, for a later use."""

    def build(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        number = ir.IntType(32)
        byte = ir.IntType(8).as_pointer()
        kinds = [byte, number, number, number]
        function = _declared(builder, "llvm.prefetch.p0", ir.VoidType(), kinds)
        entry = builder.bitcast(builder.gep(args[0], [args[1]], inbounds=True), byte)
        to_read, nearest, data = (ir.Constant(number, value) for value in (0, 3, 1))
        builder.call(function, [entry, to_read, nearest, data])
        return context.get_dummy_value()

    return types.void(place, index), build


@_lane
def load_codes(_context: Any, like: Any, place: Any, index: Any) -> tuple[Any, Callable[..., Any]]:
    """Return bytes from a place in memory on, as a vector of reals like those at another place."""
    lanes = Lanes(like.dtype)

    def build(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        codes = _bytes(builder, args[1:], lanes.count)
        return builder.sitofp(codes, context.get_value_type(lanes))

    return lanes(like, place, index), build


@_lane
def all_zero(_context: Any, like: Any, place: Any, index: Any) -> tuple[Any, Callable[..., Any]]:
    """Return whether bytes from a place in memory on are 0, as many as a vector has lanes."""
    lanes = Lanes(like.dtype)

    def build(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        whole = ir.IntType(8 * lanes.count)
        codes = builder.bitcast(_bytes(builder, args[1:], lanes.count), whole)
        return builder.icmp_unsigned("==", codes, ir.Constant(whole, 0))

    return types.boolean(like, place, index), build


def _bytes(builder: Any, args: Any, count: int) -> Any:
    return builder.load(_entries(builder, args, ir.VectorType(ir.IntType(8), count)), align=1)


@_lane
def store(_context: Any, place: Any, index: Any, value: Any) -> tuple[Any, Callable[..., Any]]:
    """Set the entries from a place in memory on to a vector, without any check."""
    if value != Lanes(place.dtype):
        raise TypeError(f"store({place}, {index}, {value})")

    def build(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        entries = _entries(builder, args, args[2].type)
        builder.store(args[2], entries, align=_BITS[place.dtype] // 8)
        return context.get_dummy_value()

    return types.void(place, index, value), build


def _entries(builder: Any, args: Any, kind: Any) -> Any:
    return builder.bitcast(builder.gep(args[0], [args[1]], inbounds=True), kind.as_pointer())


@_lane
def fill(_context: Any, place: Any, value: Any) -> tuple[Any, Callable[..., Any]]:
    """Return a vector with the same value in all lanes, of the type of the entries at a place."""
    lanes = Lanes(place.dtype)

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = context.get_value_type(lanes)
        real = context.cast(builder, args[1], signature.args[1], lanes.real)
        one = builder.insert_element(ir.Constant(kind, ir.Undefined), real, _lane_number(0))
        none = ir.Constant(ir.VectorType(ir.IntType(32), lanes.count), None)
        return builder.shuffle_vector(one, ir.Constant(kind, ir.Undefined), none)

    return lanes(place, value), build


def _lane_number(lane: int) -> Any:
    return ir.Constant(ir.IntType(32), lane)


def _shuffle(first: int) -> Callable[..., Any]:
    """Return the build of `count` lanes of two vectors in a row, from `first` on."""

    def build(_context: Any, builder: Any, signature: Any, args: Any) -> Any:
        count = signature.return_type.count
        lanes = [first % count + k for k in range(count)]
        order = ir.Constant(ir.VectorType(ir.IntType(32), count), lanes)
        return builder.shuffle_vector(args[0], args[1], order)

    return build


@_lane
def with_last_of(_context: Any, before: Any, here: Any) -> tuple[Any, Callable[..., Any]]:
    """Return the values one lane lower: the last of `before`, then `here` without its last."""
    return here(before, here), _shuffle(-1)


@_lane
def with_first_of(_context: Any, here: Any, after: Any) -> tuple[Any, Callable[..., Any]]:
    """Return the values one lane higher: `here` without its first, then the first of `after`."""
    return here(here, after), _shuffle(1)


@njit(forceinline=True)
def one_lower(before: Any, here: Any) -> Any:
    """Return six vectors one lane lower; see `with_last_of`."""
    return (
        with_last_of(before[0], here[0]),
        with_last_of(before[1], here[1]),
        with_last_of(before[2], here[2]),
        with_last_of(before[3], here[3]),
        with_last_of(before[4], here[4]),
        with_last_of(before[5], here[5]),
    )


@njit(forceinline=True)
def one_higher(here: Any, after: Any) -> Any:
    """Return six vectors one lane higher; see `with_first_of`."""
    return (
        with_first_of(here[0], after[0]),
        with_first_of(here[1], after[1]),
        with_first_of(here[2], after[2]),
        with_first_of(here[3], after[3]),
        with_first_of(here[4], after[4]),
        with_first_of(here[5], after[5]),
    )


@_lane
def select(_context: Any, mask: Any, one: Any, other: Any) -> tuple[Any, Callable[..., Any]]:
    """Return one where the mask holds, else the other."""
    if one != other or mask != Lanes(one.real, mask=True):
        raise TypeError(f"select({mask}, {one}, {other})")
    return one(mask, one, other), lambda _context, builder, _signature, args: builder.select(*args)


@_lane
def root(_context: Any, value: Any) -> tuple[Any, Callable[..., Any]]:
    """Return the square roots."""
    return value(value), _called("llvm.sqrt")


@_lane
def size(_context: Any, value: Any) -> tuple[Any, Callable[..., Any]]:
    """Return the absolute values."""
    return value(value), _called("llvm.fabs")


def _called(name: str) -> Callable[..., Any]:
    """Return the build of an intrinsic of LLVM on one vector."""

    def build(_context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind, lanes = args[0].type, signature.args[0]
        full = f"{name}.v{lanes.count}f{_BITS[lanes.real]}"
        return builder.call(_declared(builder, full, kind, [kind]), args)

    return build


def _declared(builder: Any, name: str, result: Any, arguments: list[Any]) -> Any:
    known = builder.module.globals.get(name)
    return known or ir.Function(builder.module, ir.FunctionType(result, arguments), name)


def _chosen(sign: str) -> Callable[..., Any]:
    def build(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.select(builder.fcmp_ordered(sign, *args), *args)

    return build


@_lane
def smaller(_context: Any, one: Any, other: Any) -> tuple[Any, Callable[..., Any]]:
    """Return the smaller values; those of the second vector where either is NaN."""
    return one(one, other), _chosen("<")


@_lane
def larger(_context: Any, one: Any, other: Any) -> tuple[Any, Callable[..., Any]]:
    """Return the larger values; those of the second vector where either is NaN."""
    return one(one, other), _chosen(">")


@_lane
def everywhere(_context: Any, mask: Any) -> tuple[Any, Callable[..., Any]]:
    """Return whether a mask holds in all lanes."""

    def build(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        whole = ir.IntType(mask.count)
        return builder.icmp_unsigned(
            "==", builder.bitcast(args[0], whole), ir.Constant(whole, 2**mask.count - 1)
        )

    return types.boolean(mask), build


def _operator(function: Callable[..., Any], emit: Callable[..., Any], *, compares: bool) -> None:
    """Make an operator of Python act on vectors."""

    @_lane
    def act(_context: Any, one: Any, other: Any) -> tuple[Any, Callable[..., Any]]:
        result = Lanes(one.real, mask=True) if compares else one

        def build(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
            return emit(builder, *args)

        return result(one, other), build

    # Numba wants the same signature of both functions, annotations included: hence none.
    overload(function)(
        lambda one, other: (
            (lambda one, other: act(one, other))
            if isinstance(one, Lanes) and one == other
            else None
        )
    )


_ARITHMETIC: Final[dict[Callable[..., Any], str]] = {
    operator.add: "fadd",
    operator.sub: "fsub",
    operator.mul: "fmul",
    operator.truediv: "fdiv",
}
_COMPARISONS: Final[dict[Callable[..., Any], str]] = {
    operator.lt: "<",
    operator.le: "<=",
    operator.gt: ">",
    operator.ge: ">=",
    operator.eq: "==",
}


def _define_operators() -> None:
    def arithmetic(name: str) -> Callable[..., Any]:
        return lambda builder, *args: getattr(builder, name)(*args, flags=_CONTRACT)

    def comparison(sign: str) -> Callable[..., Any]:
        return lambda builder, *args: builder.fcmp_ordered(sign, *args)

    for function, name in _ARITHMETIC.items():
        _operator(function, arithmetic(name), compares=False)
    for function, sign in _COMPARISONS.items():
        _operator(function, comparison(sign), compares=True)
    _operator(operator.and_, lambda builder, *args: builder.and_(*args), compares=True)


_define_operators()

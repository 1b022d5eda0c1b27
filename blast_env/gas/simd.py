"""Intrinsics that let the compiler turn a loop into vector instructions.

Numba compiles Python's conditional expressions to branches, and lets negative indices count from
the end. Both prevent vectorisation where the compiler cannot prove that they are unnecessary.
"""

from collections.abc import Callable
from typing import Any, Final

from numba import types
from numba.extending import intrinsic

_lane: Final[Callable[[Callable[..., Any]], Callable[..., Any]]] = intrinsic


@_lane
def select(_context: Any, condition: Any, one: Any, other: Any) -> tuple[Any, Callable[..., Any]]:
    """Return one if the condition holds, else the other; both are evaluated."""

    def build(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.select(*args)

    if condition != types.boolean or one != other:
        raise TypeError(f"select({condition}, {one}, {other})")
    return one(condition, one, other), build


@_lane
def root(_context: Any, value: Any) -> tuple[Any, Callable[..., Any]]:
    """Return the square root, without a call to the C library."""

    def build(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        function = builder.module.declare_intrinsic("llvm.sqrt", [args[0].type])
        return builder.call(function, args)

    return value(value), build


@_lane
def smaller(_context: Any, one: Any, other: Any) -> tuple[Any, Callable[..., Any]]:
    """Return the smaller of two reals; the second one if either is NaN."""

    def build(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.select(builder.fcmp_ordered("<", *args), *args)

    if one != other:
        raise TypeError(f"smaller({one}, {other})")
    return one(one, other), build


@_lane
def larger(_context: Any, one: Any, other: Any) -> tuple[Any, Callable[..., Any]]:
    """Return the larger of two reals; the second one if either is NaN."""

    def build(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.select(builder.fcmp_ordered(">", *args), *args)

    if one != other:
        raise TypeError(f"larger({one}, {other})")
    return one(one, other), build


@_lane
def get(_context: Any, array: Any, index: Any) -> tuple[Any, Callable[..., Any]]:
    """Return an entry of an array by its position in memory, without a check of bounds."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(_place(context, builder, signature, args))

    return array.dtype(array, index), build


@_lane
def put(_context: Any, array: Any, index: Any, value: Any) -> tuple[Any, Callable[..., Any]]:
    """Set an entry of an array by its position in memory, without a check of bounds."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store(args[2], _place(context, builder, signature, args))
        return context.get_dummy_value()

    if value != array.dtype:
        raise TypeError(f"put({array}, {index}, {value})")
    return types.void(array, index, value), build


def _place(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, value=args[0])
    return builder.gep(array.data, [args[1]], inbounds=True)

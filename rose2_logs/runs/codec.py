"""Values of the analysis as bytes and back: plain data only.

What is read can do nothing worse than be wrong.
"""

from __future__ import annotations

import dataclasses
import json
import struct
import typing
from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.model.labels import known_window

_LENGTH = struct.Struct("<I")
PLAIN = (str, int, float, bool, type(None))
ARRAY_KINDS = "biuf"
"""Arrays hold truth values, integers or floats (numpy's kinds)."""


def dataclasses_within(kinds: Iterable[Any]) -> dict[str, type[Any]]:
    """Find the dataclasses that types are made of, by name; those of annotations within them too."""
    found: dict[str, type[Any]] = {}
    waiting = list(kinds)
    while waiting:
        kind = waiting.pop()
        waiting += typing.get_args(kind)
        kind = typing.get_origin(kind) or kind
        if isinstance(kind, type) and dataclasses.is_dataclass(kind) and kind.__name__ not in found:
            found[kind.__name__] = kind
            waiting += typing.get_type_hints(kind).values()
    return found


class Codec:
    """Turns values to bytes and back: dataclasses, tuples, lists, dicts, arrays, geometries, numbers, texts.

    A value comes back equal to the last bit. Text and structure stand as JSON, arrays and geometries (as WKB)
    behind it; images of labels hold their used window in as few bytes as their numbers need.

    Parameters
    ----------
    kinds : iterable of types
        What values are made of: these, and the dataclasses that they hold by their annotations. Nothing else
        is ever made of bytes.
    """

    def __init__(self, kinds: Iterable[Any]) -> None:
        self._kinds = dataclasses_within(kinds)

    def encode(self, value: Any) -> bytes:
        """Return a value as bytes.

        Raises
        ------
        TypeError
            If it holds what is none of the known types.
        """
        buffers: list[bytes] = []
        text = json.dumps(self._tree(value, buffers), separators=(",", ":")).encode()
        return b"".join([_LENGTH.pack(len(text)), text, *buffers])

    def decode(self, data: bytes) -> Any:
        """Return the value that was encoded.

        Raises
        ------
        ValueError
            If the bytes are none that `encode` gives.
        """
        try:
            begin = _LENGTH.size + _LENGTH.unpack_from(data)[0]
            return self._value(json.loads(data[_LENGTH.size : begin]), memoryview(data)[begin:])
        except (struct.error, KeyError, IndexError, TypeError, shapely.errors.GEOSException) as error:
            raise ValueError(f"not what was encoded: {error}") from error

    def _tree(self, value: Any, buffers: list[bytes]) -> Any:
        match value:
            case np.ndarray():
                return _array_tree(value, buffers)
            case BaseGeometry():
                return {"wkb": _add(shapely.to_wkb(value), buffers)}
            case np.generic():
                return {"scalar": _array_tree(np.asarray(value), buffers)["array"]}
            case tuple():
                return {"tuple": [self._tree(each, buffers) for each in value]}
            case list():
                return [self._tree(each, buffers) for each in value]
            case dict():
                return {"dict": {str(name): self._tree(each, buffers) for name, each in value.items()}}
            case slice():
                return {"slice": [value.start, value.stop]}
        kind = self._kinds.get(type(value).__name__)
        if kind is type(value):
            names = [each.name for each in dataclasses.fields(kind)]
            members = {name: self._tree(getattr(value, name), buffers) for name in names}
            return {"of": kind.__name__, "is": members}
        if isinstance(value, PLAIN):
            return value
        raise TypeError(f"{type(value).__name__} cannot be encoded")

    def _value(self, tree: Any, data: memoryview) -> Any:
        match tree:
            case list():
                return [self._value(each, data) for each in tree]
            case {"array": [*about]}:
                return _array(about, data)
            case {"scalar": [*about]}:
                return _array(about, data)[()]
            case {"wkb": [int(begin), int(end)]}:
                return shapely.from_wkb(bytes(data[begin:end]))
            case {"tuple": [*members]}:
                return tuple(self._value(each, data) for each in members)
            case {"dict": dict(members)}:
                return {name: self._value(each, data) for name, each in members.items()}
            case {"slice": [start, stop]}:
                return slice(start, stop)
            case {"of": str(name), "is": dict(members)}:
                return self._kinds[name](**{key: self._value(each, data) for key, each in members.items()})
            case dict():
                raise ValueError("not what was encoded")
        return tree


def _add(data: bytes, buffers: list[bytes]) -> tuple[int, int]:
    """Put bytes behind the others; return where they begin and end."""
    begin = sum(map(len, buffers))
    buffers.append(data)
    return begin, begin + len(data)


def _array_tree(array: NDArray[Any], buffers: list[bytes]) -> dict[str, Any]:
    """Describe an array: type, shape, window that is kept, its type and shape, place of its bytes."""
    if array.dtype.kind not in ARRAY_KINDS:
        raise TypeError(f"an array of {array.dtype} cannot be encoded")
    kept, window = array, None
    if array.ndim == 2 and array.dtype.kind in "iub":
        rows, columns = known_window(array != 0)
        window, kept = [rows.start, rows.stop, columns.start, columns.stop], array[rows, columns]
        if kept.size and kept.dtype.kind == "i":
            kept = kept.astype(np.result_type(np.min_scalar_type(kept.min()), np.min_scalar_type(kept.max())))
    place = _add(np.ascontiguousarray(kept).tobytes(), buffers)
    return {"array": [array.dtype.str, array.shape, window, kept.dtype.str, kept.shape, place]}


def _array(about: list[Any], data: memoryview) -> NDArray[Any]:
    kind, shape, window, kept_kind, kept_shape, (begin, end) = about
    if np.dtype(kind).kind not in ARRAY_KINDS:
        raise ValueError(f"no array of {kind} was encoded")
    kept = np.frombuffer(data[begin:end], np.dtype(kept_kind)).reshape(kept_shape)
    if window is None:
        return kept.astype(kind)
    whole = np.zeros(shape, kind)
    whole[window[0] : window[1], window[2] : window[3]] = kept
    return whole

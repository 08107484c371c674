"""Results as bytes and back: MessagePack of dataclasses, arrays and geometries.

Damaged input can only give wrong values: nothing but the declared types is ever created.
"""

from __future__ import annotations

from typing import Any, Generic, TypeVar, cast, get_origin

import msgspec
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.errors import InvalidMapError
from rose2_logs.model.labels import known_window

ARRAY_KINDS = "biuf"
"""Arrays hold truth values, integers or floats (numpy's kinds)."""

Value = TypeVar("Value")


class Serializer(Generic[Value]):
    """Turns values of one declared type to bytes and back, equal to the last bit.

    Geometries are WKB; of arrays with two axes of integers, as images of labels are, the used window is
    kept in as few bytes as its numbers need.

    Parameters
    ----------
    kind : type
        Type of the values, of dataclasses, tuples, dicts, arrays, geometries, numbers and texts.
    """

    def __init__(self, kind: Any) -> None:
        self._encoder = msgspec.msgpack.Encoder(enc_hook=_encoded)
        self._decoder = msgspec.msgpack.Decoder(kind, dec_hook=_decoded)

    def encode(self, value: Value) -> bytes:
        """Return a value as bytes.

        Raises
        ------
        TypeError
            If it holds what cannot be encoded.
        """
        return self._encoder.encode(value)

    def decode(self, data: bytes) -> Value:
        """Return the value that was encoded.

        Raises
        ------
        ValueError
            If the bytes are none that `encode` gives.
        """
        try:
            return cast("Value", self._decoder.decode(data))
        except (msgspec.DecodeError, InvalidMapError) as error:
            raise ValueError(f"not what was encoded: {error}") from error


def _encoded(value: Any) -> Any:
    match value:
        case np.ndarray():
            return _encoded_array(value)
        case BaseGeometry():
            return shapely.to_wkb(value)
        case np.generic():
            return value.item()
    raise TypeError(f"{type(value).__name__} cannot be encoded")


def _decoded(kind: Any, value: Any) -> Any:
    kind = get_origin(kind) or kind
    if kind is np.ndarray:
        return _decoded_array(*value)
    if issubclass(kind, BaseGeometry):
        try:
            return shapely.from_wkb(value)
        except shapely.errors.GEOSException as error:
            raise ValueError(str(error)) from error
    raise TypeError(f"{kind.__name__} cannot be decoded")


def _encoded_array(array: NDArray[Any]) -> tuple[Any, ...]:
    """Type and shape of an array, the window that is kept of it, the type of what is kept, and its bytes."""
    if array.dtype.kind not in ARRAY_KINDS:
        raise TypeError(f"an array of {array.dtype} cannot be encoded")
    kept, window = array, None
    if array.ndim == 2 and array.dtype.kind in "iub":
        rows, columns = known_window(array != 0)
        window, kept = (rows.start, rows.stop, columns.start, columns.stop), array[rows, columns]
        if kept.size and kept.dtype.kind == "i":
            kept = kept.astype(_smallest_type(int(kept.min()), int(kept.max())))
    return array.dtype.str, array.shape, window, kept.dtype.str, kept.tobytes()


def _smallest_type(least: int, most: int) -> np.dtype[Any]:
    """Integer type of fewest bytes that holds both numbers."""
    # The common type of both by NumPy would be a float for some; signed types reach one further below zero.
    return np.min_scalar_type(most if least >= 0 else min(least, -1 - most))


def _decoded_array(
    kind: str, shape: list[int], window: list[int] | None, kept_kind: str, data: bytes
) -> NDArray[Any]:
    if np.dtype(kind).kind not in ARRAY_KINDS or np.dtype(kept_kind).kind not in ARRAY_KINDS:
        raise ValueError(f"no array of {kind} was encoded")
    kept = np.frombuffer(data, np.dtype(kept_kind))
    if window is None:
        return kept.reshape(shape).astype(kind)
    top, bottom, left, right = window
    whole = np.zeros(shape, kind)
    part = whole[top:bottom, left:right]
    part[...] = kept.reshape(part.shape)
    return whole

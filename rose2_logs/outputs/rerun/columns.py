"""What an entity of a recording can show at a snapshot, and several of these as Rerun's columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

_STRIPS_TYPE = rr.components.LineStrip3DBatch([]).as_arrow_array().type
_BLOBS_TYPE = rr.encodings.BlobBatch([]).as_arrow_array().type


@dataclass(frozen=True, eq=False)
class Strips:
    """Lines.

    Attributes
    ----------
    points_m : (N, 3) float32
        Corners of all strips, one after the other.
    lengths : (S,) int32
        Number of corners of each strip.
    colors : (S, 3) uint8, optional
        Of each strip, where they are not styled once for all.
    """

    points_m: NDArray[np.float32]
    lengths: NDArray[np.int32]
    colors: NDArray[np.uint8] | None = None


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture at a position in the world.

    Attributes
    ----------
    pixels : (H, W) or (H, W, 4) uint8
        Gray or colors, the top row first.
    cell_m : float
        Side of a pixel.
    corner_m : (float, float, float)
        Position of its lower left corner in the world.
    yaw_rad : float
        How it is turned, counter-clockwise.
    colormap : Colormap, optional
        Of gray pixels; the same in all rows.
    """

    pixels: NDArray[np.uint8]
    cell_m: float
    corner_m: tuple[float, float, float]
    yaw_rad: float
    colormap: rr.components.Colormap | None = None


@dataclass(frozen=True)
class Label:
    """A text at a point of the world, meters."""

    point_m: tuple[float, float, float]
    text: str


@dataclass(frozen=True)
class Scalar:
    """A point of a curve."""

    value: float


@dataclass(frozen=True)
class Entry:
    """A line of the list of events, with its level."""

    text: str
    level: str


LayerKind = Strips | Picture | Label | Scalar | Entry


def columns_of(rows: Sequence[LayerKind]) -> rr.ComponentColumnList:
    """Make the columns of rows that are all of one kind."""
    match rows[0]:
        case Strips():
            return _strips(cast(Sequence[Strips], rows))
        case Picture():
            return _pictures(cast(Sequence[Picture], rows))
        case Label():
            labels = cast(Sequence[Label], rows)
            points = np.array([row.point_m for row in labels], np.float32)
            return rr.Points3D.columns(positions=points, labels=[row.text for row in labels])
        case Scalar():
            return rr.Scalars.columns(scalars=np.array([row.value for row in cast(Sequence[Scalar], rows)]))
        case Entry():
            entries = cast(Sequence[Entry], rows)
            return rr.TextLog.columns(
                text=[row.text for row in entries], level=[row.level for row in entries]
            )


def _strips(rows: Sequence[Strips]) -> rr.ComponentColumnList:
    ends = np.cumsum(np.concatenate([[0], *(row.lengths for row in rows)]), dtype=np.int32)
    points = rr.encodings.Vec3DBatch(np.concatenate([row.points_m for row in rows])).as_arrow_array()
    # As Rerun does it itself for arrays of strips that are all of one length.
    strips = pa.ListArray.from_arrays(pa.array(ends), points, type=_STRIPS_TYPE)
    colors = [row.colors for row in rows if row.colors is not None]
    columns = rr.LineStrips3D.columns(strips=strips, colors=np.concatenate(colors) if colors else None)
    return columns.partition([len(row.lengths) for row in rows])


def _blobs(parts: Sequence[NDArray[np.uint8]]) -> pa.ListArray:
    """As Rerun does it itself, which copies all bytes twice; of a single part none is copied."""
    ends = np.cumsum([0, *map(len, parts)], dtype=np.int32)
    inner = parts[0] if len(parts) == 1 else np.concatenate(parts)
    return pa.ListArray.from_arrays(pa.array(ends), pa.array(inner), type=_BLOBS_TYPE)


def _pictures(rows: Sequence[Picture]) -> rr.ComponentColumnList:
    turns = [(0.0, 0.0, float(np.sin(row.yaw_rad / 2)), float(np.cos(row.yaw_rad / 2))) for row in rows]
    formats = [
        rr.components.ImageFormat(
            width=row.pixels.shape[1],
            height=row.pixels.shape[0],
            color_model="L" if row.pixels.ndim == 2 else "RGBA",
            channel_datatype="U8",
        )
        for row in rows
    ]
    colormap = rows[0].colormap
    return rr.GridMap.columns(
        data=_blobs([row.pixels.reshape(-1) for row in rows]),
        format=formats,
        cell_size=[row.cell_m for row in rows],
        translation=np.array([row.corner_m for row in rows], np.float32),
        quaternion=[rr.Quaternion(xyzw=turn) for turn in turns],
        draw_order=[row.corner_m[2] for row in rows],
        colormap=None if colormap is None else [colormap] * len(rows),
    )

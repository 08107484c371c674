"""Buildings that are not all at right angles: wings at a slant, arcs, bends around a corner."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fit_grouping.buildings.raster import Generator, Mask, between
from fit_grouping.buildings.walls import WalledPlan

FloatImage = NDArray[np.float32]

KINDS = {"none": 0.62, "slant": 0.14, "arc": 0.06, "bend": 0.18}
"""Shares of the ways to bend a building."""
OTHER_KINDS = {
    "villa": {"none": 0.93, "slant": 0.04, "arc": 0.0, "bend": 0.03},
    "hall": {"none": 0.5, "slant": 0.14, "arc": 0.16, "bend": 0.2},
    "depot": {"none": 1.0},
    "arena": {"none": 1.0},
    "warehouse": {"none": 1.0},
    "loop": {"none": 0.85, "slant": 0.1, "arc": 0.05},
    "openhome": {"none": 0.9, "slant": 0.06, "bend": 0.04},
    "hallways": {"none": 0.9, "slant": 0.06, "bend": 0.04},
    "cellular": {"none": 0.8, "slant": 0.1, "bend": 0.1},
    "wings": {"none": 0.85, "slant": 0.12, "arc": 0.03},
    "gallery": {"none": 0.6, "slant": 0.15, "arc": 0.12, "bend": 0.13},
    "passage": {"none": 0.74, "slant": 0.1, "arc": 0.08, "bend": 0.08},
}
"""The same for kinds of plans that differ: wings of villas are turned anyway, halls may lie in an arc,
and the grounds of depots and arenas are not bent with them."""


def bent(rng: Generator, walled: WalledPlan, furniture: Mask) -> tuple[WalledPlan, Mask]:
    """Bend a building and what stands in it in a random way."""
    shares = OTHER_KINDS.get(walled.plan.kind, KINDS)
    kind = rng.choice(list(shares), p=list(shares.values()))
    if kind == "none":
        return walled, furniture
    height, width = furniture.shape
    turns = int(rng.integers(2))
    if turns:
        height, width = width, height
    if kind == "slant":
        x, y = _slant(rng, width, height)
    elif kind == "arc":
        x, y = _arc(rng, width, height)
    else:
        x, y = _bend(rng, width, height)
    rooms, other, walls, glass, things = (
        moved(np.rot90(image, turns), x, y)
        for image in (walled.plan.rooms, walled.other, walled.walls, walled.glass, furniture)
    )
    # Points of a curved raster miss cells of thin walls here and there.
    closed = cv2.morphologyEx(walls, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)).astype(np.uint8)
    plan = replace(walled.plan, rooms=rooms.astype(np.int32))
    building = replace(
        walled, plan=plan, walls=closed, glass=glass.astype(np.uint8), other=other.astype(np.int32)
    )
    return building, things.astype(np.uint8)


def moved(
    image: NDArray[np.integer[Any]], from_x: FloatImage, from_y: FloatImage, fill: int = 0
) -> NDArray[np.integer[Any]]:
    """Image whose cells come from the given places of another; labels below 2^24."""
    exact = image if image.dtype == np.uint8 else image.astype(np.float32)
    out = cv2.remap(
        np.ascontiguousarray(exact),
        from_x,
        from_y,
        cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=float(fill),
    )
    return out.astype(image.dtype)


def _slant(rng: Generator, width: int, height: int) -> tuple[FloatImage, FloatImage]:
    """A wing leaves the line of the rest by a few degrees."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    at, angle = rng.uniform(0.2, 0.8) * width, rng.normal(0, 0.07)
    return x, (y + np.float32(angle) * np.maximum(x - np.float32(at), 0)).astype(np.float32)


def _arc(rng: Generator, width: int, height: int) -> tuple[FloatImage, FloatImage]:
    """All of the building follows an arc."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    radius = rng.uniform(0.8, 2.5) * max(height, width)
    return x, (y + (x - width / 2) ** 2 / np.float32(2 * radius)).astype(np.float32)


def _bend(rng: Generator, width: int, height: int) -> tuple[FloatImage, FloatImage]:
    """The building goes round a corner along an arc and goes straight on at another angle.

    Points of the new raster are led back: those before the corner stay, those within the angle by their angle
    and distance from the corner's center, those beyond by turning them back.
    """
    angle = np.float32(rng.choice([np.pi / 4, np.pi / 2, rng.uniform(0.3, 1.6)], p=[0.35, 0.2, 0.45]))
    at = np.float32(rng.uniform(0.3, 0.75) * width)
    center_y = np.float32(height + between(rng, 0.5, 6.0))
    middle = np.float32(center_y - height / 2)
    """Radius at which the arc is as long as the piece of the building that it takes."""
    along = angle * middle
    beyond = max(float(width - at - along), 0.0)
    sine, cosine = np.sin(angle), np.cos(angle)
    columns = int(np.ceil(at + sine * center_y + max(cosine, 0) * beyond))
    rows = int(np.ceil(max(height, center_y + sine * beyond - cosine * (center_y - height))))
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    dx, dy = x - at, center_y - y
    turn = np.arctan2(dx, dy)
    radius = np.hypot(dx, dy)
    beyond_x = cosine * dx - sine * dy
    beyond_y = sine * dx + cosine * dy
    straight = (dx <= 0) & (dy > 0)
    curved = (turn >= 0) & (turn <= angle)
    source_x = np.where(straight, x, np.where(curved, at + turn * middle, at + along + beyond_x))
    source_y = np.where(straight, y, np.where(curved, center_y - radius, center_y - beyond_y))
    # Beyond the corner only what lies ahead of it, and not behind the center.
    valid = straight | curved | ((beyond_x > 0) & (beyond_y > 0) & (turn > angle))
    source_x = np.where(valid, source_x, -1).astype(np.float32)
    used = valid & (source_x >= 0) & (source_x < width) & (source_y >= 0) & (source_y < height)
    rows_used, columns_used = np.flatnonzero(used.any(1)), np.flatnonzero(used.any(0))
    window = np.s_[rows_used[0] : rows_used[-1] + 1, columns_used[0] : columns_used[-1] + 1]
    return source_x[window], source_y.astype(np.float32)[window]

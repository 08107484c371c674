"""A small run as a folder of saved maps: the simplest log there is."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

RESOLUTION_M = 0.05
WALL, FREE, UNKNOWN = 0, 254, 205


def two_rooms(seen_columns: int = 240) -> NDArray[np.uint8]:
    """Gray image of two rooms of 5 x 5 m with a door of 1 m between them, seen up to a column."""
    image = np.full((120, 240), UNKNOWN, np.uint8)
    for left in (10, 116):
        image[8:112, left : left + 108] = WALL
        image[10:110, left + 2 : left + 106] = FREE
    image[50:70, 114:120] = FREE
    image[:, seen_columns:] = UNKNOWN
    return image


def save_map(folder: Path, name: str, image: NDArray[np.uint8]) -> Path:
    """Write an image with its .yaml as map_server does; return the .yaml."""
    folder.mkdir(parents=True, exist_ok=True)
    Image.fromarray(image).save(folder / f"{name}.png")
    text = f"image: {name}.png\nresolution: {RESOLUTION_M}\norigin: [1.0, 2.0, 0.0]\nnegate: 0\n"
    path = folder / f"{name}.yaml"
    path.write_text(text + "occupied_thresh: 0.65\nfree_thresh: 0.196\n")
    return path


def save_run(folder: Path, seen: tuple[int, ...] = (115, 180, 240)) -> Path:
    """Write a run in which more and more of the two rooms is seen; return its folder."""
    for number, columns in enumerate(seen):
        save_map(folder, f"map{number}", two_rooms(columns))
    return folder


@contextmanager
def held_at(folder: Path, number: int) -> Iterator[None]:
    """Let whoever reads a run wait before one of its maps, so that it is at work however busy the machine is.

    Its image is a named pipe meanwhile, which nobody writes to.
    """
    image, aside = folder / f"map{number}.png", folder / f"map{number}.png.aside"
    image.rename(aside)
    os.mkfifo(image)
    try:
        yield
    finally:
        aside.replace(image)

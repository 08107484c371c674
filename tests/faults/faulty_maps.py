"""Saved maps with a fault: a folder of three, the second of which is spoilt."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from faulty_logs import cut, flip, png_claiming, room
from PIL import Image

COUNT = 3
ALIASES = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [*{before}, *{before}, *{before}, *{before}, *{before}, *{before}, *{before}]\n"
    for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)
"""A few lines of YAML that stand for 10 million words."""


def write_maps(folder: Path, ending: str) -> Path:
    """Write the maps as map_server does; return their folder."""
    folder.mkdir()
    for k in range(COUNT):
        cells = room(40 + 20 * k, k)
        pixels = np.select([cells == 100, cells >= 0], [0, 254], 205).astype(np.uint8)
        Image.fromarray(pixels[::-1]).save(folder / f"map{k}.{ending}")
        (folder / f"map{k}.yaml").write_text(
            f"image: map{k}.{ending}\nresolution: 0.05\norigin: [1.0, 2.0, 0.0]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
        )
    return folder


def _described(old: str, new: str) -> Callable[[Path, Path], None]:
    def spoil(yaml: Path, image: Path) -> None:
        text = yaml.read_text()
        assert old in text
        yaml.write_text(text.replace(old, new))

    return spoil


def _image(spoil: Callable[[Path], None]) -> Callable[[Path, Path], None]:
    return lambda yaml, image: spoil(image)


def _pixels(pixels: np.ndarray) -> Callable[[Path, Path], None]:
    return lambda yaml, image: Image.fromarray(pixels.astype(np.uint8)).save(image)


def _claims(width: int, height: int) -> Callable[[Path, Path], None]:
    """An image that claims a size and holds ten bytes."""

    def spoil(yaml: Path, image: Path) -> None:
        if image.suffix == ".png":
            image.write_bytes(png_claiming(width, height, bytes(10)))
        else:
            image.write_bytes(b"P5\n%d %d\n255\n" % (width, height) + bytes(10))

    return spoil


def _png_bomb(yaml: Path, image: Path) -> None:
    """An image of 10 x 10 whose data go on for 64 MB."""
    data = bytes(64 << 20)
    image.write_bytes(png_claiming(10, 10, data) if image.suffix == ".png" else b"P5\n10 10\n255\n" + data)


SAVED_FAULTS: dict[str, Callable[[Path, Path], None]] = {
    "nothing wrong": lambda yaml, image: None,
    "description empty": lambda yaml, image: yaml.write_text(""),
    "description not YAML": lambda yaml, image: yaml.write_text("image: [map"),
    "description nested 10,000 deep": _described("[1.0, 2.0, 0.0]", "[" * 10_000),
    "description of 10 million words in aliases": lambda yaml, image: yaml.write_text(
        ALIASES + yaml.read_text().replace("[1.0, 2.0, 0.0]", "*i")
    ),
    "resolution 0": _described("0.05", "0"),
    "resolution NaN": _described("0.05", ".nan"),
    "resolution negative": _described("0.05", "-0.05"),
    "resolution 1e9 m": _described("0.05", "1.0e+9"),
    "resolution of 400 digits": _described("0.05", "1" + "0" * 400),
    "origin NaN": _described("1.0", ".nan"),
    "origin 1e300 m": _described("1.0", "1.0e+300"),
    "origin missing": _described("origin", "begin"),
    "thresholds the wrong way round": _described("0.65", "0.1"),
    "image missing": _image(lambda image: image.unlink()),
    "image empty": _image(lambda image: cut(image, 0)),
    "image cut at 60 %": _image(lambda image: cut(image, image.stat().st_size * 6 // 10)),
    "image with a byte flipped at 60 %": _image(lambda image: flip(image, image.stat().st_size * 6 // 10)),
    "image of 1 x 1": _pixels(np.full((1, 1), 254)),
    "image all unknown": _pixels(np.full((40, 40), 205)),
    "image all occupied": _pixels(np.zeros((40, 40))),
    "image claims 0 x 0": _claims(0, 0),
    "image claims 13,000 x 13,000": _claims(13_000, 13_000),
    "image claims 2^31 - 1 squared": _claims(2**31 - 1, 2**31 - 1),
    "image of 10 x 10 goes on for 64 MB": _png_bomb,
}

"""What was fitted, as data: the network, the trees, and the manifest that names them (see the model card)."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from pathlib import Path
from typing import Any

from rose2_logs.segmentation.regions.answers import AnsweringNetwork
from rose2_logs.segmentation.regions.features import REGION_FEATURES
from rose2_logs.segmentation.regions.own_rooms import OWN_ROOM_FEATURES
from rose2_logs.segmentation.regions.strengths import BoostedTrees, read_trees

FOLDER = Path(__file__).parent
NETWORK, JOINS, OUTSIDE, OWN_ROOMS = "borders.onnx", "joins.npz", "outside.npz", "own_rooms.npz"
FILES = (NETWORK, JOINS, OUTSIDE, OWN_ROOMS)
MANIFEST = "manifest.json"


@cache
def answering_network() -> AnsweringNetwork:
    """The network, read once in a process."""
    return AnsweringNetwork(FOLDER / NETWORK)


@cache
def join_trees() -> BoostedTrees:
    """Trees that say whether two regions are one room."""
    return read_trees(FOLDER / JOINS)


@cache
def outside_trees() -> BoostedTrees:
    """Trees that say whether a region is a room or outside."""
    return read_trees(FOLDER / OUTSIDE, REGION_FEATURES)


@cache
def own_room_trees() -> BoostedTrees:
    """Trees that say whether a small region is a room of its own."""
    return read_trees(FOLDER / OWN_ROOMS, OWN_ROOM_FEATURES)


def manifest() -> dict[str, Any]:
    """What the files are: their hashes, and how they were fitted."""
    found: dict[str, Any] = json.loads((FOLDER / MANIFEST).read_text(encoding="utf-8"))
    return found


def sha256_of(path: Path) -> str:
    """Hash of a file, as the manifest lists it."""
    return hashlib.sha256(path.read_bytes()).hexdigest()

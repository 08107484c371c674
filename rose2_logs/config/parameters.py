"""Every number that a result depends on: one frozen block per stage, with unit, default and reason.

Lengths are meters (``_m``, ``_m2``), angles radians (``_rad``), times seconds (``_s``); shares lie in [0, 1].
A configuration file is TOML with one table per block; ``resolved`` gives the same shape back.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rose2_logs.config.baselines import (
    DistanceParameters,
    MorphologicalParameters,
    VoronoiBaselineParameters,
    VoronoiMergeParameters,
)
from rose2_logs.config.fields import choice, number
from rose2_logs.errors import ParameterError


@dataclass(frozen=True)
class ReadingParameters:
    """How much a log may claim before it is refused as damaged or hostile; real ones stay far below."""

    map_max_cells: int = number(
        2**27,
        "cells",
        "Largest map that is read: 579 m squared at 5 cm; of an image 2.7 GB are needed.",
        1,
    )
    chunk_max_bytes: int = number(
        2**28, "bytes", "Largest chunk or message once decompressed: a largest map; usual is 1 MB.", 1024
    )
    map_max_messages: int = number(
        2_000_000, "messages", "Most messages of a map's topics: one a second for 23 days.", 1
    )


@dataclass(frozen=True)
class OccupancyParameters:
    """Which cells count as occupied and which as free."""

    occupied_min_percent: float = number(
        65.0, "%", "Cells above are occupied; map_server's default occupied_thresh.", 0, 100
    )
    free_max_percent: float = number(
        19.6, "%", "Known cells below are free; map_server's default free_thresh.", 0, 100
    )
    working_resolution_m: float = number(
        0.05, "m", "Finer maps are analyzed in blocks up to this size: SLAM's usual cell.", 0.0
    )
    analyzed_max_cells: int = number(
        20_000_000, "cells", "Explored parts with more are analyzed in blocks; 220 m squared at 5 cm.", 10_000
    )

    def unblocked(self) -> OccupancyParameters:
        """Return the same, for methods that take every map at its own resolution."""
        return dataclasses.replace(self, working_resolution_m=0.0, analyzed_max_cells=2**62)


@dataclass(frozen=True)
class SpectrumParameters:
    """Stage A: dominant directions, structure score, clean map (paper, III-A)."""

    wall_sigma_m: float = number(0.06, "m", "Walls in SLAM maps wobble by about one cell of 5 cm.", 0.001)
    longest_wave_m: float = number(10.0, "m", "Longer waves show the building's outline, not its walls.", 0.1)
    shortest_wave_m: float = number(0.25, "m", "Shorter waves show the raster (five cells of 5 cm).", 0.001)
    angle_step_rad: float = number(
        math.radians(0.25), "rad", "A wall of 10 m leaves its line by less than a cell.", 1e-4, 0.2
    )
    angle_sigma_rad: float = number(
        math.radians(0.75), "rad", "Smoothing of the angular energy, three bins.", 0.0, 0.2
    )
    peak_min_prominence: float = number(
        0.12,
        "share of the range",
        "A direction's peak stands out by this much: one wing of a building.",
        0,
        1,
    )
    direction_min_gap_rad: float = number(
        math.radians(5.0), "rad", "Directions closer than this are one.", 0.0, 1.5
    )
    structure_length_m: float = number(
        4.0,
        "m",
        "Length of wall over which a cell gathers its score: a room's side, more than furniture.",
        0.01,
    )
    piece_max_gap_m: float = number(0.25, "m", "Occupied cells hang together over gaps of five cells.", 0.0)
    piece_min_extent_m: float = number(
        1.6, "m", "Pieces longer than a door is wide may be walls by themselves.", 0.0
    )
    piece_min_score: float = number(
        0.5, "score", "Shorter pieces are walls where this share of the line through them is wall.", 0, 1
    )
    threshold_min: float = number(0.25, "score", "Least threshold of the clean map that is tried.", 0, 1)
    threshold_max: float = number(0.85, "score", "Greatest threshold of the clean map that is tried.", 0, 1)
    threshold_step: float = number(0.05, "score", "Step of the search for the threshold.", 0.001, 1)
    attached_share: float = number(
        0.5, "share", "Cells of this share of the threshold that touch the clean map are wall too.", 0, 1
    )
    walls_max_per_m2: float = number(
        0.15, "1/m2", "Wall clusters per free area of a clean map; empty floor plans have about 0.1.", 0.0
    )


@dataclass(frozen=True)
class WallParameters:
    """Stage B: segments, wall clusters, representative lines (paper, III-B)."""

    segment_min_length_m: float = number(0.4, "m", "Shortest segment: a wall beside a door.", 0.01)
    segment_max_gap_m: float = number(0.25, "m", "Gap bridged within a segment; the paper's 5 cells.", 0.0)
    segment_min_fill: float = number(
        0.6, "share", "Least share of a segment that cells cover: more than half is wall.", 0, 1
    )
    direction_tolerance_rad: float = number(
        math.radians(6.0), "rad", "A segment this near to a dominant direction follows it.", 0.0, 0.8
    )
    local_direction_step_rad: float = number(
        math.pi / 36, "rad", "Curved walls are approximated by chords every 5 degrees.", 0.02, 0.8
    )
    cluster_lateral_m: float = number(0.15, "m", "Offset within one wall cluster: a wall's thickness.", 0.01)
    cluster_gap_m: float = number(0.6, "m", "Gap along one wall cluster: furniture before a wall.", 0.01)
    local_segment_min_length_m: float = number(
        1.2, "m", "Off the dominant directions only walls longer than most furniture count.", 0.01
    )
    line_lateral_m: float = number(0.2, "m", "Both faces of one wall share a representative line.", 0.0)
    extension_m: float = number(
        8.0, "m", "A wall may go on unseen for a room's width beyond its evidence.", 0.0
    )
    local_extension_m: float = number(1.0, "m", "A chord of a curved wall reaches to the next chord.", 0.0)
    extension_per_length: float = number(4.0, "1", "A short wall reaches not further than this times itself.")
    line_min_weight: float = number(0.1, "share", "Least covered share of a line; the paper's value.", 0, 1)


@dataclass(frozen=True)
class FloorPlanParameters:
    """Stage C: edge weights, faces, rooms (paper, III-C)."""

    wall_tolerance_m: float = number(
        0.15, "m", "A wall counts for an edge when it lies this near: a wall's half thickness and drift.", 0.0
    )
    blind_look_m: float = number(
        0.4,
        "m",
        "A wall is blind with no free space this near behind it, more than its thickness; 0: none is.",
        0.0,
    )
    face_min_seen: float = number(
        0.1, "share", "A face less seen than this is outside: it holds rays through windows.", 0, 1
    )
    shape_min_seen: float = number(
        0.2, "share", "A face seen this much belongs to its room's predicted shape; the paper's value.", 0, 1
    )
    grouping: str = choice(
        "agglomerative",
        ("agglomerative", "dbscan"),
        "How faces are joined to rooms: by whole borders, or pair by pair with DBSCAN as in the paper.",
    )
    dbscan_max_weight: float = number(
        0.24, "share", "DBSCAN joins faces with edges up to this weight: exp(-w / 0.125) = 0.15.", 0, 1
    )
    join_min_openness: float = number(
        0.7, "share", "Faces join when at least this share of their known border is open.", 0, 1
    )
    join_min_open_m: float = number(0.15, "m", "Least open border for faces to join: three cells of 5 cm.", 0)
    join_min_passage: float = number(
        0.7, "1", "Faces join when the passage is this wide against the narrower one's width.", 0
    )
    passage_look_widths: float = number(
        2.0, "1", "How far from a passage its width is compared with the room's, in widths.", 0.0
    )
    passage_look_max_m: float = number(3.0, "m", "The same at most: half a large room.", 0.0)
    doorway_max_width_m: float = number(
        2.0, "m", "A gap in a wall up to this width is a doorway: a double door.", 0.0
    )
    jamb_length_m: float = number(0.5, "m", "Wall beside a gap that makes it one: a jamb.", 0.01)
    jamb_min_fill: float = number(0.6, "share", "Least share of a jamb that walls cover.", 0, 1)
    leak_max_width_m: float = number(
        0.5, "m", "Free space outside rooms that is narrower is rays; wider it is part of a room.", 0.0
    )
    border_strip_m: float = number(
        0.25, "m", "Strips of a room narrower than this, along a wall's other side, change room.", 0.0
    )
    room_min_area_m2: float = number(3.0, "m2", "Smaller pieces of free space are no rooms.", 0.0)
    room_min_clearance_m: float = number(0.6, "m", "Half the width of the narrowest room.", 0.0)


@dataclass(frozen=True)
class TopologyParameters:
    """Stage D: Voronoi graph, splitting of rooms, doorways (paper, III-D)."""

    summit_reach_m: float = number(
        0.15, "m", "A summit of the clearance is the highest this far around: a wall's thickness.", 0.0
    )
    passage_min_ratio: float = number(
        0.2, "share", "A passage joins with this share of the clearance beside it; gaps have less.", 0, 1
    )
    split_min_clearance_m: float = number(
        0.5, "m", "Parts narrower on both sides of their middle are niches.", 0.0
    )
    split_min_area_m2: float = number(3.0, "m2", "Smaller parts are niches: the least room.", 0.0)
    split_min_purity: float = number(0.98, "share", "A cut leaves this share of each part on its side.", 0, 1)
    max_rounds: int = number(5, "1", "Rounds of splitting; the paper's implementation has five.", 0, 100)
    doorway_min_width_m: float = number(0.3, "m", "Narrower contacts of two rooms are noise.", 0.0)


@dataclass(frozen=True)
class TrackingParameters:
    """Identity of rooms over the snapshots of a run."""

    match_min_iou: float = number(
        0.2, "share", "Least overlap for a room to continue a track; half-seen rooms double in size.", 0, 1
    )
    part_min_share: float = number(
        0.5, "share", "A room is part of another when most of it lies in it: never of two at once.", 0, 1
    )
    shapes_kept: int = number(
        3, "shapes", "Shapes by which a track is known: whole, part, and as it was seen before.", 1
    )
    shape_same_iou: float = number(0.8, "share", "A shape like one in memory by this takes its place.", 0, 1)
    lost_kept: int = number(
        500, "tracks", "Lost rooms that may return; some kilobytes each, the longest lost go first."
    )
    shift_min_m: float = number(
        0.1, "m", "The whole map moved when its walls did by this on average: two cells of 5 cm.", 0.0
    )
    shift_search_m: float = number(
        2.0, "m", "How far the whole map may leap in a loop closure and still be laid over itself.", 0.0, 50
    )
    shift_search_rad: float = number(math.radians(5.0), "rad", "How far it may turn, likewise.", 0.0, math.pi)
    shift_min_share: float = number(
        0.5, "share", "A motion of the map is believed when it brings most of its walls together.", 0, 1
    )
    back_projected_min_area_m2: float = number(
        1.5, "m2", "A lesser glimpse of a room of the last map is no room yet: half the least room.", 0.0
    )


@dataclass(frozen=True)
class Parameters:
    """All blocks."""

    reading: ReadingParameters = field(default_factory=ReadingParameters)
    occupancy: OccupancyParameters = field(default_factory=OccupancyParameters)
    spectrum: SpectrumParameters = field(default_factory=SpectrumParameters)
    walls: WallParameters = field(default_factory=WallParameters)
    floor_plan: FloorPlanParameters = field(default_factory=FloorPlanParameters)
    topology: TopologyParameters = field(default_factory=TopologyParameters)
    morphological: MorphologicalParameters = field(default_factory=MorphologicalParameters)
    distance: DistanceParameters = field(default_factory=DistanceParameters)
    voronoi: VoronoiBaselineParameters = field(default_factory=VoronoiBaselineParameters)
    voronoi_merge: VoronoiMergeParameters = field(default_factory=VoronoiMergeParameters)
    tracking: TrackingParameters = field(default_factory=TrackingParameters)

    def resolved(self) -> dict[str, dict[str, float | int | bool | str]]:
        """Every parameter with its value, block by block, as written beside the results."""
        return dataclasses.asdict(self)

    def replaced(self, changes: Mapping[str, Mapping[str, Any]]) -> Parameters:
        """Return a copy with some values changed.

        Parameters
        ----------
        changes : mapping of block name to mapping of parameter name to value

        Raises
        ------
        ParameterError
            If a block or a name does not exist, or a value has the wrong type or lies out of bounds.
        """
        blocks = {block.name: getattr(self, block.name) for block in dataclasses.fields(self)}
        for block_name, values in changes.items():
            if block_name not in blocks:
                meant = _meant(
                    block_name
                    if not isinstance(values, Mapping)
                    else f"{block_name}.{next(iter(values), '')}"
                )
                raise ParameterError(
                    f"no parameter block {block_name!r}{meant}; there are: {', '.join(blocks)}"
                )
            if not isinstance(values, Mapping):
                raise ParameterError(f"{block_name!r} must be a table of parameters, not {values!r}")
            blocks[block_name] = _replaced_block(block_name, blocks[block_name], values)
        return Parameters(**blocks)


def _replaced_block(block_name: str, block: Any, values: Mapping[str, Any]) -> Any:
    declared = {item.name: item for item in dataclasses.fields(block)}
    checked = {}
    for name, value in values.items():
        if name not in declared:
            full_name = f"{block_name}.{name}"
            raise ParameterError(
                f"no parameter {full_name}{_meant(full_name)}; there are: {', '.join(declared)}"
            )
        checked[name] = _checked(f"{block_name}.{name}", declared[name], value)
    return dataclasses.replace(block, **checked)


def _meant(name: str) -> str:
    """Ask for the parameter, in the named block or else in any, whose name is next to one there is not."""
    block, _, own = name.rpartition(".")
    rows = describe_parameters()
    for among in ([row for row in rows if row["block"] == block], rows):
        if near := difflib.get_close_matches(own, [row["name"] for row in among], 1):
            found = next(row for row in among if row["name"] == near[0])
            return f"; did you mean {found['block']}.{found['name']}?"
    return ""


def _checked(name: str, declared: dataclasses.Field[Any], value: Any) -> Any:
    kind: Any = type(declared.default)
    if isinstance(value, bool) is not (kind is bool) or not isinstance(
        value, (int, float) if kind is float else kind
    ):
        raise ParameterError(f"{name} must be of type {kind.__name__}, not {value!r}")
    meta = declared.metadata
    if "choices" in meta and value not in meta["choices"]:
        raise ParameterError(f"{name} is {value!r}; it must be one of {', '.join(meta['choices'])}")
    if kind in (int, float) and not (meta["low"] <= value <= meta["high"]):
        raise ParameterError(f"{name} is {value}; it must lie between {meta['low']} and {meta['high']}")
    checked: float | int | bool | str = kind(value)
    return checked


def load_parameters(config: Path | None = None, settings: Iterable[str] = ()) -> Parameters:
    """Read the parameters of a run.

    Parameters
    ----------
    config : path, optional
        TOML file with one table per block.
    settings : iterable of str
        ``block.name=value`` with the value written as in TOML, a name also without quotes, which shells take
        away; they win over the file.

    Raises
    ------
    ParameterError
        If the file or a setting cannot be read or names something that does not exist.
    """
    parameters = Parameters()
    if config is not None:
        try:
            parameters = parameters.replaced(tomllib.loads(config.read_text(encoding="utf-8")))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise ParameterError(f"{config}: cannot be read as TOML: {error}") from error
    for setting in settings:
        try:
            parsed = _parsed_setting(setting)
        except tomllib.TOMLDecodeError as error:
            raise ParameterError(f"{setting!r}: write it as block.name=value") from error
        if not all(isinstance(values, Mapping) for values in parsed.values()):
            meant = _meant(next(iter(parsed)))
            raise ParameterError(f"{setting!r}: write it as block.name=value{meant}")
        parameters = parameters.replaced(parsed)
    return parameters


def _parsed_setting(setting: str) -> dict[str, Any]:
    try:
        return tomllib.loads(setting)
    except tomllib.TOMLDecodeError:
        name, sign, value = setting.partition("=")
        if not sign or not value.strip().isidentifier():
            raise
        return tomllib.loads(f'{name}="{value.strip()}"')


def describe_parameters() -> list[dict[str, Any]]:
    """List every parameter: block, name, default, unit, bounds and reason."""
    rows = []
    for block in dataclasses.fields(Parameters):
        for item in dataclasses.fields(getattr(Parameters(), block.name)):
            rows.append({"block": block.name, "name": item.name, "default": item.default, **item.metadata})
    return rows

"""Every number that a result depends on: one frozen block per stage, with unit, default and reason.

Lengths are meters (``_m``, ``_m2``), angles radians (``_rad``), times seconds (``_s``); shares are in [0, 1].
A configuration file is TOML with one table per block; ``resolved`` gives the same shape back.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import reprlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from rose2_logs.config.baselines import (
    DistanceParameters,
    MorphologicalParameters,
    VoronoiBaselineParameters,
    VoronoiMergeParameters,
)
from rose2_logs.config.comparison import ComparisonParameters
from rose2_logs.config.fields import ParameterBlock, choice, number
from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.config.kinds import KindParameters
from rose2_logs.config.mapping import MappingParameters
from rose2_logs.config.reading import ReadingParameters
from rose2_logs.config.regions import RegionParameters
from rose2_logs.config.topology import TopologyParameters
from rose2_logs.config.tracking import QualityParameters, TrackingParameters
from rose2_logs.errors import ParameterError

CELL_VALUES = ("auto", "stored", "percent", "zero_one", "fifty_unknown", "costs")
"""How the numbers in the cells of maps can be read."""

FAR_CELLS = ("leave_out", "keep")
"""What can be done with known cells far from the rest of a map."""

LONGEST_SHOWN = 100
"""Signs of a setting that a message shows."""


@dataclass(frozen=True, repr=False)
class OccupancyParameters(ParameterBlock):
    """Which cells count as occupied and which as free.

    Attributes
    ----------
    implied : mapping
        Thresholds that are named apply to the numbers as they are stored.
    """

    block: ClassVar[str] = "occupancy"
    ascending: ClassVar[tuple[tuple[str, ...], ...]] = (("free_max_percent", "occupied_min_percent"),)
    implied: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "free_max_percent": {"values": "percent"},
        "occupied_min_percent": {"values": "percent"},
    }

    values: str = choice(
        "auto",
        CELL_VALUES,
        "What the numbers in cells mean: auto decides it from the maps and tells where it is not the usual; "
        "stored takes percent, saved maps by their own thresholds; percent takes the thresholds below, also "
        "for saved maps, and so does naming one of these.",
    )
    occupied_min_percent: float = number(
        65.0, "%", "Cells above are occupied; map_server's default occupied_thresh.", 0, 100
    )
    free_max_percent: float = number(
        19.6, "%", "Known cells below are free; map_server's default free_thresh.", 0, 100
    )
    working_resolution_m: float = number(
        0.05, "m", "Finer maps are analyzed in blocks of up to this size: the usual cell size of SLAM.", 0.0
    )
    analyzed_max_cells: int = number(
        20_000_000,
        "cells",
        "Explored areas with more cells are analyzed in blocks: 220 m by 220 m at 5 cm.",
        10_000,
        2**40,
    )
    far_cells: str = choice(
        "leave_out",
        FAR_CELLS,
        "Whether stray specks and rays far from what was explored are left out: with them a map costs as if "
        "all between were explored.",
    )
    far_margin_m: float = number(
        5.0, "m", "What is nearer to explored floor always stays: rays into the next room.", 0.0, 100.0
    )
    far_min_area_m2: float = number(
        3.0, "m2", "Floor of this area stays wherever it is: the smallest room.", 0.0
    )
    far_min_gain: float = number(
        1.25,
        "1",
        "Only what makes the rectangle around the known cells so many times larger is left out.",
        1.0,
        1000.0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.values == "auto" and not self.implied.keys().isdisjoint(self.changed()):
            object.__setattr__(self, "values", "percent")


@dataclass(frozen=True, repr=False)
class SpectrumParameters(ParameterBlock):
    """Stage A: dominant directions, structure score, clean map (paper, III-A)."""

    block: ClassVar[str] = "spectrum"
    ascending: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("shortest_wave_m", "longest_wave_m"),
        ("threshold_min", "threshold_max"),
    )

    wall_sigma_m: float = number(
        0.06, "m", "Walls in SLAM maps deviate from a line by about one cell of 5 cm.", 0.001
    )
    wall_sigma_min_cells: float = number(
        0.5,
        "cells",
        "Blur of coarse maps, whose cells are larger than this deviation: less leaves steps.",
        0.1,
    )
    longest_wave_m: float = number(10.0, "m", "Longer waves show the building's outline, not its walls.", 0.1)
    shortest_wave_m: float = number(
        0.25, "m", "Shorter waves show the grid itself (five cells of 5 cm).", 0.001
    )
    angle_step_rad: float = number(
        math.radians(0.25),
        "rad",
        "Over 10 m of wall, an error of half a step is less than a cell.",
        1e-4,
        0.2,
    )
    angle_sigma_rad: float = number(
        math.radians(0.75), "rad", "Smoothing of the angular energy, three bins.", 1e-4, 0.2
    )
    peak_min_prominence: float = number(
        0.12,
        "share of the range",
        "A direction's peak must stand out by this much: enough for one wing of a building.",
        0,
        1,
    )
    direction_min_gap_rad: float = number(
        math.radians(5.0), "rad", "Directions closer than this are one.", 0.0, 1.5
    )
    structure_length_m: float = number(
        4.0,
        "m",
        "Length of wall that contributes to a cell's score: the side of a room, longer than furniture.",
        0.01,
    )
    piece_max_gap_m: float = number(
        0.25, "m", "Occupied cells belong together across gaps of up to five cells.", 0.0
    )
    piece_min_extent_m: float = number(
        1.6, "m", "Pieces longer than a door is wide may be walls on their own.", 0.0
    )
    piece_min_score: float = number(
        0.5, "score", "Shorter pieces are walls if this share of the line through them is wall.", 0, 1
    )
    threshold_min: float = number(0.25, "score", "Lowest threshold that is tried for the clean map.", 0, 1)
    threshold_max: float = number(0.85, "score", "Highest threshold that is tried for the clean map.", 0, 1)
    threshold_step: float = number(0.05, "score", "Step of the search for the threshold.", 0.001, 1)
    attached_share: float = number(
        0.5, "share", "Cells with this share of the threshold next to the clean map are walls, too.", 0, 1
    )
    walls_max_per_m2: float = number(
        0.15,
        "1/m2",
        "Most wall clusters per free area in the clean map; empty floor plans have about 0.1.",
        0.0,
    )


@dataclass(frozen=True, repr=False)
class WallParameters(ParameterBlock):
    """Stage B: segments, wall clusters, representative lines (paper, III-B)."""

    block: ClassVar[str] = "walls"

    segment_min_length_m: float = number(0.4, "m", "Shortest segment: a wall beside a door.", 0.01)
    segment_max_gap_m: float = number(0.25, "m", "Gap bridged within a segment; the paper's 5 cells.", 0.0)
    segment_cover_cells: float = number(
        1.5,
        "cells",
        "Cells along a line that are this close cover the gap between them: a diagonal, rounded up.",
        1.0,
    )
    segment_min_fill: float = number(
        0.6, "share", "Minimum share of a segment that is covered by occupied cells: more than half.", 0, 1
    )
    direction_tolerance_rad: float = number(
        math.radians(6.0), "rad", "A segment within this angle of a dominant direction follows it.", 0.0, 0.8
    )
    local_direction_step_rad: float = number(
        math.pi / 36, "rad", "Curved walls are approximated by chords every 5 degrees.", 0.02, 0.8
    )
    cluster_lateral_m: float = number(0.15, "m", "Offset within one wall cluster: a wall's thickness.", 0.01)
    cluster_gap_m: float = number(0.6, "m", "Gap along one wall cluster: furniture in front of a wall.", 0.01)
    local_segment_min_length_m: float = number(
        1.2, "m", "Away from the dominant directions, only walls longer than most furniture count.", 0.01
    )
    line_lateral_m: float = number(0.2, "m", "Both faces of one wall share a representative line.", 0.0)
    extension_m: float = number(
        8.0, "m", "A wall may continue unseen for the width of a room beyond its segments.", 0.0
    )
    local_extension_m: float = number(1.0, "m", "A chord of a curved wall reaches to the next chord.", 0.0)
    extension_per_length: float = number(
        4.0, "1", "A line extends beyond its wall by at most this many times the wall's length."
    )
    line_min_weight: float = number(
        0.1, "share", "Minimum share of a line that is covered by walls; the paper's value.", 0, 1
    )


@dataclass(frozen=True, repr=False)
class Parameters:
    """All blocks.

    Raises
    ------
    ParameterError
        If a block is not of its type; blocks check their values themselves.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> rl.Parameters.from_any({"walls.extension_m": 6}).walls.extension_m
    6.0
    """

    reading: ReadingParameters = field(default_factory=ReadingParameters)
    mapping: MappingParameters = field(default_factory=MappingParameters)
    occupancy: OccupancyParameters = field(default_factory=OccupancyParameters)
    spectrum: SpectrumParameters = field(default_factory=SpectrumParameters)
    walls: WallParameters = field(default_factory=WallParameters)
    floor_plan: FloorPlanParameters = field(default_factory=FloorPlanParameters)
    regions: RegionParameters = field(default_factory=RegionParameters)
    topology: TopologyParameters = field(default_factory=TopologyParameters)
    quality: QualityParameters = field(default_factory=QualityParameters)
    morphological: MorphologicalParameters = field(default_factory=MorphologicalParameters)
    distance: DistanceParameters = field(default_factory=DistanceParameters)
    voronoi: VoronoiBaselineParameters = field(default_factory=VoronoiBaselineParameters)
    voronoi_merge: VoronoiMergeParameters = field(default_factory=VoronoiMergeParameters)
    tracking: TrackingParameters = field(default_factory=TrackingParameters)
    comparison: ComparisonParameters = field(default_factory=ComparisonParameters)
    kinds: KindParameters = field(default_factory=KindParameters)

    def __post_init__(self) -> None:
        for declared in dataclasses.fields(self):
            kind: Any = declared.default_factory
            if not isinstance(value := getattr(self, declared.name), kind):
                raise ParameterError(f"{declared.name} must be {kind.__name__}, not {reprlib.repr(value)}")

    def __repr__(self) -> str:
        blocks = ((block.name, getattr(self, block.name)) for block in dataclasses.fields(self))
        shown = (f"{name}={block!r}" for name, block in blocks if block.changed())
        return f"Parameters({', '.join(shown)})"

    @classmethod
    def from_any(cls, value: Parameters | Mapping[str, Any] | None = None) -> Parameters:
        """Make parameters of whatever names them.

        Parameters
        ----------
        value : Parameters or mapping, optional
            Parameters are returned as they are; None gives the defaults. A mapping holds values by dotted
            name, ``{"walls.extension_m": 6}``, or mappings by block, ``{"walls": {"extension_m": 6}}``.

        Raises
        ------
        ParameterError
            If a block or a name does not exist, or a value has the wrong type or lies out of bounds.

        Examples
        --------
        >>> Parameters.from_any({"walls.extension_m": 6})
        Parameters(walls=WallParameters(extension_m=6.0))
        """
        if isinstance(value, cls):
            return value
        if value is not None and not isinstance(value, Mapping):
            raise ParameterError(
                f"parameters must be Parameters or a dict of values, not {reprlib.repr(value)}"
            )
        return cls().replaced(value or {})

    def without_effect(self) -> list[str]:
        """Say of each parameter that differs from its default, but that the grouping does not ask for, so.

        Examples
        --------
        >>> import rose2_logs as rl
        >>> rl.Parameters.from_any({"floor_plan.known_power": 1}).without_effect()
        ['floor_plan.known_power has no effect with floor_plan.grouping=fitted; it has with walls and dbscan']
        """
        grouping, told = self.floor_plan.grouping, []
        blocks = [getattr(self, block.name) for block in dataclasses.fields(self)]
        for block in blocks:
            for name in block.changed():
                groupings = block.groupings.get(name, (grouping,))
                if grouping in groupings:
                    continue
                others = [
                    f"{other.block}.{name}"
                    for other in blocks
                    if grouping in other.groupings.get(name, ()) and hasattr(other, name)
                ]
                hint = f"{others[0]} has" if others else f"it has with {' and '.join(groupings)}"
                told.append(f"{block.block}.{name} has no effect with floor_plan.grouping={grouping}; {hint}")
        return told

    def resolved(self) -> dict[str, dict[str, float | int | str]]:
        """Every parameter with its value, block by block, as written with the results."""
        return dataclasses.asdict(self)

    def replaced(self, changes: Mapping[str, Any]) -> Parameters:
        """Return a copy with some values changed.

        Parameters
        ----------
        changes : mapping
            Values by dotted name, or mappings of values by the name of their block.

        Raises
        ------
        ParameterError
            If a block or a name does not exist, or a value has the wrong type or lies out of bounds.
        """
        blocks = {block.name: getattr(self, block.name) for block in dataclasses.fields(self)}
        for name, values in _by_block(changes, blocks).items():
            blocks[name] = _replaced_block(name, blocks[name], values)
        return Parameters(**blocks)


def _by_block(changes: Mapping[str, Any], blocks: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Values by name in mappings by block, of dotted names and of such mappings."""
    nested: dict[str, dict[str, Any]] = {}
    for key, given in changes.items():
        name, dot, parameter = str(key).partition(".")
        values = {parameter: given} if dot else given
        if name not in blocks:
            first = next(iter(values), "") if isinstance(values, Mapping) else ""
            full_name = f"{name}.{first}" if first else name
            meant = f"did you mean {first}?" if first in blocks else _meant(full_name)
            hint = meant or f"there are: {', '.join(blocks)}"
            raise ParameterError(f"no parameter block {name!r}; {hint}")
        if not isinstance(values, Mapping):
            raise ParameterError(f"{name!r} must be a table of parameters, not {reprlib.repr(values)}")
        nested.setdefault(name, {}).update(values)
    return nested


def _replaced_block(block_name: str, block: Any, values: Mapping[str, Any]) -> Any:
    names = [declared.name for declared in dataclasses.fields(block)]
    for name in values:
        if name not in names:
            full_name = f"{block_name}.{name}"
            hint = _meant(full_name) or f"there are: {', '.join(names)}"
            raise ParameterError(f"no parameter {full_name}; {hint}")
    implied = {
        other: value
        for name in values
        for other, value in block.implied.get(name, {}).items()
        if other not in block.changed()
    }
    return dataclasses.replace(block, **(implied | dict(values)))


def _meant(name: str) -> str:
    """Ask for the parameter, in the named block or else in any, whose name is next to one there is not."""
    block, _, own = name.rpartition(".")
    # Of two of one name, the one that has an effect by default is meant.
    rows = sorted(describe_parameters(), key=lambda row: not row["has_effect"])
    for among in ([row for row in rows if row["block"] == block], rows):
        if near := difflib.get_close_matches(own, [row["name"] for row in among], 1):
            closest = next(row for row in among if row["name"] == near[0])
            return f"did you mean {closest['block']}.{closest['name']}?"
    return ""


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
        import tomllib

        try:
            parameters = parameters.replaced(tomllib.loads(config.read_text(encoding="utf-8")))
        except OSError as error:
            raise ParameterError(f"{config}: cannot be read: {error.strerror}") from error
        except (ValueError, RecursionError) as error:
            raise ParameterError(f"{config}: cannot be read as TOML: {error}") from error
    for setting in settings:
        try:
            parsed = _parsed_setting(setting)
        except (ValueError, RecursionError) as error:  # also a number of thousands of digits
            shown = setting if len(setting) <= LONGEST_SHOWN else f"{setting[:LONGEST_SHOWN]}..."
            name, sign, _ = setting.partition("=")
            hint = "; its value is a number as 4.5, a name, or true or false" if sign and "." in name else ""
            raise ParameterError(f"setting {shown!r}: write it as block.name=value{hint}") from error
        if not all(isinstance(values, Mapping) for values in parsed.values()):
            name = next(iter(parsed))
            is_block = name in (block.name for block in dataclasses.fields(parameters))
            meant = "which of its parameters?" if is_block else _meant(name)
            hint = f"; {meant}" if meant else ""
            raise ParameterError(f"setting {setting!r}: write it as block.name=value{hint}")
        parameters = parameters.replaced(parsed)
    return parameters


def _parsed_setting(setting: str) -> dict[str, Any]:
    import tomllib

    try:
        return tomllib.loads(setting)
    except tomllib.TOMLDecodeError:
        name, sign, value = setting.partition("=")
        if not sign or not value.strip().isidentifier():
            raise
        return tomllib.loads(f'{name}="{value.strip()}"')


def describe_parameters() -> list[dict[str, Any]]:
    """List every parameter: block, name, default, unit, bounds, reason, whether it counts by default."""
    rows, defaults = [], Parameters()
    grouping = defaults.floor_plan.grouping
    for block in dataclasses.fields(Parameters):
        values = getattr(defaults, block.name)
        for item in dataclasses.fields(values):
            has_effect = grouping in values.groupings.get(item.name, (grouping,))
            row = {"block": block.name, "name": item.name, "default": item.default, "has_effect": has_effect}
            rows.append(row | item.metadata)
    return rows

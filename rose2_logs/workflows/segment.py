"""One saved map to its rooms: label image, floor plan as GeoJSON, picture."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from rose2_logs.config.parameters import Parameters
from rose2_logs.config.run_options import RunOptions, check_option, with_detail
from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.image_files import write_label_image
from rose2_logs.drawing.plan import draw_segmentation
from rose2_logs.drawing.plot import plot_plan
from rose2_logs.errors import LogError, ParameterError
from rose2_logs.io import open_log
from rose2_logs.io.cell_values import oddity
from rose2_logs.io.discovery import IMAGE_ENDINGS, LOSSY_ENDINGS, MAP_ENDINGS
from rose2_logs.io.saved_maps import MapFilesSource
from rose2_logs.model.analysis import SnapshotAnalysis, left_out_note
from rose2_logs.model.borders import Border
from rose2_logs.model.explored import coarser_for_its_size
from rose2_logs.model.far_cells import find_far_cells
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.model.room_plan import RoomPlan, plan_of_analysis
from rose2_logs.model.rooms import RoomMap
from rose2_logs.outputs.exports.formats import planned_files, write_plan
from rose2_logs.outputs.exports.geojson import plan_geojson
from rose2_logs.runs.summary import write_json
from rose2_logs.segmentation.pipeline import RoomTree, analyze_with_tree
from rose2_logs.system.files import refuse_existing, require_utf8
from rose2_logs.system.warnings import log_warning
from rose2_logs.workflows.without_effect import tell_without_effect

logger = logging.getLogger(__name__)

DEFAULTS = Parameters()


@dataclass(frozen=True, eq=False, repr=False)
class Segmentation(SnapshotAnalysis):
    """The analysis of a single map, which can be drawn.

    Attributes
    ----------
    snapshot : OccupancySnapshot
        The map.
    parameters : Parameters
        Those of the analysis.
    name : str
        What the map is called.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> with rl.open_log("sample_logs/office.mcap") as reader:
    ...     found = rl.segment(reader.last())
    >>> len(found.plan().rooms), found.figure()
    (18, Drawing('/map', ...))
    """

    snapshot: OccupancySnapshot = field(kw_only=True)
    parameters: Parameters = field(kw_only=True)
    name: str = "map"
    _tree: RoomTree | None = None

    def __getstate__(self) -> dict[str, Any]:
        # The tree is worth its memory while one looks at a map, but not a way between processes.
        return self.__dict__ | {"_tree": None}

    def at_detail(self, detail: float | None) -> Segmentation:
        """Divide the same map into more or fewer rooms, without analyzing it again.

        More detail never joins what less detail parts, but for floor too small for a room. The result is
        that of `segment` with this detail, but for the Voronoi graph, which stays as it is.

        Parameters
        ----------
        detail : float
            Log odds: 0 parts what is likelier two rooms than one; positive gives more and smaller rooms,
            negative fewer and larger ones. None leaves it as it is.

        Raises
        ------
        ParameterError
            If it is out of bounds, or the rooms do not come from borders with a fitted strength.

        Examples
        --------
        >>> import rose2_logs as rl
        >>> with rl.open_log("sample_logs/office.mcap") as reader:
        ...     found = rl.segment(reader.last())
        >>> len(found.at_detail(-5).rooms) <= len(found.rooms) <= len(found.at_detail(5).rooms)
        True
        """
        parameters = with_detail(self.parameters, detail, "rose2" if self.walls is not None else "other")
        if self._tree is None:
            return segment_snapshot(
                self.snapshot, parameters, name=self.name, voronoi=self.voronoi_m is not None
            )
        found = self._tree.at_detail(self, self.snapshot, parameters.regions.detail)
        return replace(found, parameters=parameters)

    def plan(self) -> RoomPlan:
        """Return the floor plan: rooms by their numbers, doorways, walls and the map."""
        assert self.quality is not None  # it comes with every analysis
        return plan_of_analysis(self.snapshot, self, self.quality, self.name, self.parameters.occupancy)

    def figure(self) -> Drawing:
        """Draw the map with its rooms, unseen parts, doorways and a scale bar.

        Returns
        -------
        Drawing
            Shown in notebooks; ``drawing.save("rooms.svg")`` or ``.png`` writes it.
        """
        return draw_segmentation(self.plan())

    def plot(self, ax: Any = None) -> Any:
        """Draw the map with its rooms with matplotlib; return the Axes.

        Raises
        ------
        MissingPackageError
            If matplotlib is not installed.
        """
        return plot_plan(self.plan(), ax)

    def _repr_svg_(self) -> str:
        return self.figure()._repr_svg_()


@dataclass(frozen=True)
class StaticMapResult:
    """What `segment_map` found and wrote."""

    rooms: RoomMap
    borders: tuple[Border, ...]
    folder: Path
    files: tuple[Path, ...]


def segment_snapshot(
    snapshot: OccupancySnapshot,
    parameters: Parameters,
    method: str = "rose2",
    *,
    name: str = "map",
    voronoi: bool = False,
    read: Sequence[str] = ("reading",),
) -> Segmentation:
    """Segment a single map.

    It is warned of what was left out, of a map that is odd, of coarser cells that a large map took, and of
    parameters that were set in vain, but for those of the blocks by which the map was `read`.
    """
    check_option(RunOptions, "method", method)
    tell_without_effect(parameters, *read, method=method)
    far = find_far_cells(snapshot.cells, snapshot.geometry.resolution_m, parameters.occupancy)
    if far is not None:
        log_warning(logger, "far_cells", f"{name}: {far.note}")
    if (odd := oddity(snapshot, parameters.occupancy)) is not None:
        log_warning(logger, odd[0], f"{name}: {odd[1]}")
    found, tree = analyze_with_tree(snapshot, parameters, method, voronoi=voronoi)
    notes = {
        "coarser": coarser_for_its_size(snapshot.geometry, found.resolution_m, parameters.occupancy),
        "outside": left_out_note(found.outside_m2, found.free_area_m2),
    }
    for kind, note in notes.items():
        if note is not None:
            log_warning(logger, kind, f"{name}: {note}")
    stages = {each.name: getattr(found, each.name) for each in fields(found)}
    return Segmentation(**stages, snapshot=snapshot, parameters=parameters, name=name, _tree=tree)


def segment_map(
    map_file: Path,
    folder: Path,
    parameters: Parameters,
    method: str = "rose2",
    *,
    formats: Sequence[str] = (),
    resolution_m: float | None = None,
    overwrite: bool = False,
) -> StaticMapResult:
    """Segment a saved map and write what was found.

    Parameters
    ----------
    map_file : path
        A map_server ``.yaml``, or an image in the gray values of ROS maps.
    folder : path
        Receives ``<name>.labels.png`` (0 = none, row 0 at the top like the image),
        ``<name>.floor_plan.geojson`` and ``<name>.rooms.png``.
    parameters, method
        As for `analyze`.
    formats : sequence of str
        Further formats for the floor plan, see `exports.formats`.
    resolution_m : float, optional
        Side of a cell, for an image without a ``.yaml`` next to it; its origin is then its lower left corner.
    overwrite : bool
        Whether earlier results may be replaced.

    Raises
    ------
    LogError, InvalidMapError, ParameterError
        If the map cannot be read, or its resolution is neither given nor in a ``.yaml`` next to it.
    OutputError
        If results exist and may not be replaced, cannot be written, or could not name the map.
    """
    for named in (map_file, folder):
        require_utf8(named)
    name = map_file.stem
    files = tuple(
        folder / f"{name}{ending}" for ending in (".labels.png", ".floor_plan.geojson", ".rooms.png")
    )
    more = planned_files([each for each in formats if each != "geojson"], folder, name)
    refuse_existing([*files, *more], overwrite=overwrite)
    snapshot = read_static_map(map_file, resolution_m, parameters)
    found = segment_snapshot(snapshot, parameters, method, name=name)
    plan = found.plan()
    write_label_image(files[0], np.flipud(found.labels))
    write_json(files[1], plan_geojson(plan, found.walls))
    found.figure().save(files[2])
    more = write_plan(plan, [each for each in formats if each != "geojson"], folder, name)
    return StaticMapResult(found.rooms, found.borders, folder, (*files, *more))


def read_static_map(
    map_file: Path, resolution_m: float | None = None, parameters: Parameters = DEFAULTS
) -> OccupancySnapshot:
    """Read a saved map; an image without a ``.yaml`` needs its resolution.

    Of the parameters, those of ``reading`` and ``occupancy`` count.

    Raises
    ------
    LogError, InvalidMapError, ParameterError
        If it cannot be read, is a log, or its resolution is neither given nor in a ``.yaml`` next to it.
    """
    if not map_file.is_file():
        what = "is a folder, not a file; name the map in it" if map_file.is_dir() else "there is no such file"
        raise LogError(f"{map_file}: {what}")
    ending = map_file.suffix.lower()
    if ending in LOSSY_ENDINGS:
        raise LogError(
            f"{map_file}: this kind of image does not keep the grays of a map exactly; save the map as .png, "
            "or give the .yaml that describes it"
        )
    is_described = any(map_file.with_suffix(each).exists() for each in MAP_ENDINGS)
    is_bare = ending in IMAGE_ENDINGS and not is_described
    if is_bare and resolution_m is None:
        raise ParameterError(
            f"{map_file}: there is no .yaml next to it; give the side of a cell in meters (resolution_m=0.05)"
        )
    if resolution_m is not None and (ending in MAP_ENDINGS or (ending in IMAGE_ENDINGS and is_described)):
        raise ParameterError(
            f"{map_file}: its .yaml gives the resolution; leave out resolution_m={resolution_m:g}"
        )
    # The labels are to be as large as the image, whatever is analyzed of it.
    limits, occupancy = parameters.reading, replace(parameters.occupancy, far_cells="keep")
    with (
        _described(map_file, resolution_m if is_bare else None) as log,
        open_log(log, limits=limits, occupancy=occupancy) as reader,
    ):
        if not isinstance(reader.source, MapFilesSource):
            own = "" if resolution_m is None else ", and tells its resolution itself"
            raise LogError(
                f"{map_file}: is a log, not a saved map{own}; analyze it as a log to find the rooms of its "
                "maps"
            )
        # Unlike `first`, this tells what is odd about the map.
        return replace(next(reader.snapshots()), read_by=parameters.occupancy)


@contextmanager
def _described(map_file: Path, resolution_m: float | None) -> Iterator[Path]:
    """Give the map itself, or a description as map_server writes it for an image that has none."""
    if resolution_m is None:
        yield map_file
        return
    import yaml

    with tempfile.TemporaryDirectory() as folder:
        described = Path(folder) / f"{map_file.stem}.yaml"
        about = {"image": str(map_file.resolve()), "resolution": resolution_m, "origin": [0.0, 0.0, 0.0]}
        described.write_text(yaml.safe_dump(about), encoding="utf-8")
        yield described

"""Two folders of results to what differs between their last layouts: tables, summary, picture, recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.comparison.layouts import LayoutComparison, compare_layouts
from rose2_logs.comparison.placement import PlacedMap
from rose2_logs.config.parameters import Parameters, ReadingParameters
from rose2_logs.config.selection import Selection
from rose2_logs.errors import LogError, ParameterError
from rose2_logs.io import open_log
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.runs.folder import RunResults
from rose2_logs.runs.tables import SUMMARY
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.system.files import refuse_existing, writing

FILES = (
    "room_changes.parquet",
    "wall_changes.parquet",
    "comparison.json",
    "comparison.png",
    "comparison.rrd",
)


@dataclass(frozen=True)
class ComparisonResult:
    """What `compare_runs` found and wrote."""

    comparison: LayoutComparison
    folder: Path
    files: tuple[Path, ...]


def compare_runs(
    folder_a: Path, folder_b: Path, folder: Path, *, recording: bool = True, overwrite: bool = False
) -> ComparisonResult:
    """Compare the last layouts of two runs and write what differs.

    Parameters
    ----------
    folder_a, folder_b : path
        Results of `analyze_log`; B is laid over A.
    folder : path
        Receives the files of `FILES`.
    recording : bool
        Whether to write the Rerun recording.
    overwrite : bool
        Whether an earlier comparison may be replaced.

    Raises
    ------
    LogError
        If a folder holds no results, or the last map of a run is neither there nor at its log's place, or has
        too few walls to tell how it lies.
    OutputError
        If there is a comparison already and it may not be replaced, or a file cannot be written.
    """
    from rose2_logs.drawing.image_files import write_image
    from rose2_logs.drawing.layout_picture import draw_layout_comparison
    from rose2_logs.outputs.comparison_tables import write_comparison_summary, write_comparison_tables

    files = tuple(folder / name for name in FILES)
    refuse_existing(files, overwrite=overwrite)
    name_a, name_b = _names(folder_a, folder_b)
    a, b = read_final_layout(folder_a, name_a), read_final_layout(folder_b, name_b)
    comparison = compare_layouts(a, b)
    if comparison is None:
        few = folder_a if not a.map.can_be_placed else folder_b
        raise LogError(f"{few}: the last map has too few walls to be laid over another")
    write_comparison_tables(files[0], files[1], comparison)
    write_comparison_summary(files[2], comparison, folder_a, folder_b)
    write_image(files[3], draw_layout_comparison(comparison))
    if recording:
        from rose2_logs.outputs.rerun.comparison import write_comparison_recording

        write_comparison_recording(files[4], comparison)
        return ComparisonResult(comparison, folder, files)
    with writing(files[4]):
        files[4].unlink(missing_ok=True)  # of the comparison that this one replaces
    return ComparisonResult(comparison, folder, files[:-1])


def _names(folder_a: Path, folder_b: Path) -> tuple[str, str]:
    """Name two folders by as much of their ends as tells them apart."""
    parts_a, parts_b = folder_a.resolve().parts, folder_b.resolve().parts
    for count in range(1, max(len(parts_a), len(parts_b))):
        if parts_a[-count:] != parts_b[-count:]:
            return "/".join(parts_a[-count:]), "/".join(parts_b[-count:])
    return folder_a.resolve().name, folder_b.resolve().name


def read_final_layout(folder: Path, name: str | None = None) -> FinalLayout:
    """Read the last layout of a run from its results.

    The run is called by the folder's name unless told otherwise. The rooms come from the tables, the map from
    the annotated MCAP or else from the log itself; the walls, which no table holds, are found in it once more
    by the run's parameters.

    Raises
    ------
    LogError
        If there are no results, or the map is not to be found or is another one.
    """
    results = RunResults(folder)
    summary = results.summary
    try:
        parameters = Parameters().replaced(summary["parameters"])
        last_ns, method = int(summary["results"]["last_log_time_ns"]), str(summary["method"])
    except (KeyError, TypeError, ValueError, ParameterError) as error:
        raise LogError(
            f"{folder / SUMMARY}: is of another version ({error}); analyze the log again"
        ) from error
    last = results.choose()
    rooms = results.table("rooms", ["track", "area_m2", "polygon_wkb"], last).to_pylist()
    snapshot = _last_map(results, last_ns, parameters.reading)
    analysis = analyze(snapshot, parameters, method)
    if not np.isclose(analysis.free_area_m2, results.row(last)["free_area_m2"]):
        log = summary["log"]
        raise LogError(f"{folder}: {log} does not hold the map that the results are of; analyze it again")
    return FinalLayout(
        name=name or results.name,
        map=PlacedMap(snapshot, parameters.occupancy),
        tracks=tuple(row["track"] for row in rooms),
        shapes=tuple(shapely.from_wkb([row["polygon_wkb"] for row in rooms])),
        areas_m2=np.array([row["area_m2"] for row in rooms], float),
        walls=analysis.walls,
    )


def _last_map(results: RunResults, last_ns: int, limits: ReadingParameters) -> OccupancySnapshot:
    topic, annotated = str(results.summary["topic"]), results.annotated_log
    selection = Selection(last_ns, last_ns)
    try:
        with open_log(
            annotated or results.find_log(), topic=topic, selection=selection, limits=limits
        ) as reader:
            return reader.last()
    except LogError as error:
        if annotated is not None:
            raise
        raise LogError(
            f"{results.folder}: holds no annotated MCAP, and the last map cannot be read from the log "
            f"({error}); put the log back, or analyze it again without annotated_log=False"
        ) from error

"""What people call from scripts and notebooks; ``import rose2_logs`` offers all of it."""

from __future__ import annotations

import dataclasses
import difflib
import inspect
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain, islice
from numbers import Real
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numpy.typing import ArrayLike

from rose2_logs.comparison.layouts import LayoutComparison
from rose2_logs.config.parameters import Parameters
from rose2_logs.config.run_options import RunOptions, check_option, options_of, with_detail
from rose2_logs.config.selection import Selection
from rose2_logs.errors import InvalidMapError, ParameterError
from rose2_logs.io import map_topics as map_topics_of_log
from rose2_logs.io import open_log as open_log_reader
from rose2_logs.io.given_maps import (
    decided_reading,
    in_percent,
    read_alike,
    snapshot_of_array,
    with_maps,
    with_snapshot,
)
from rose2_logs.io.log import LogReader
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.runs.run import Run
from rose2_logs.runs.sink import Sink
from rose2_logs.runs.stream import TrackedStream, start_workers
from rose2_logs.system.files import expanded, require_local
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot
from rose2_logs.workflows.analyze import OnSnapshot, analyze_log, log_stem
from rose2_logs.workflows.compare import compare_runs, compare_stored
from rose2_logs.workflows.evaluate import Evaluation, evaluate_method
from rose2_logs.workflows.segment import Segmentation, read_static_map, segment_snapshot
from rose2_logs.workflows.without_effect import following, tell_without_effect

__all__ = ["analyze", "compare", "evaluate", "load", "map_topics", "open_log", "read_map", "segment", "track"]

GivenParameters = Parameters | Mapping[str, Any] | None
"""Parameters, or a mapping of dotted names (``{"walls.extension_m": 6}``); None for the defaults."""


def _with_run_options(function: Callable[..., Run]) -> Callable[..., Run]:
    """Give a function that takes the options of a run as keywords their names, defaults and meanings."""
    own = inspect.signature(function)
    options = [each for each in dataclasses.fields(RunOptions) if each.name not in own.parameters]
    added = [
        inspect.Parameter(
            each.name, inspect.Parameter.KEYWORD_ONLY, default=_default(each), annotation=each.type
        )
        for each in options
    ]
    kept = [each for each in own.parameters.values() if each.kind is not inspect.Parameter.VAR_KEYWORD]
    function.__signature__ = own.replace(parameters=[*kept, *added])  # type: ignore[attr-defined]
    about = options_of(RunOptions)
    lines = [f"{each.name} : {each.type}\n        {about[each.name].help}" for each in options]
    function.__doc__ = (function.__doc__ or "").replace("**options", "\n    ".join(lines))
    return function


def _default(of: dataclasses.Field[Any]) -> Any:
    return of.default if of.default_factory is dataclasses.MISSING else of.default_factory()


@_with_run_options
def analyze(
    log: str | Path,
    out: str | Path | None = None,
    *,
    parameters: GivenParameters = None,
    sinks: Sequence[Sink] = (),
    on_snapshot: OnSnapshot | None = None,
    **options: Any,
) -> Run:
    """Find and follow the rooms in all maps of a log.

    Parameters
    ----------
    log : str or path
        An MCAP file, a ROS 1 bag, a ROS 2 bag, saved maps.
    out : str or path, optional
        Folder for the results, which is created. Without it, nothing stays on the disk: the stored run is
        deleted together with the `Run` object, and there is no recording or annotated MCAP unless asked for.
    parameters : Parameters or mapping, optional
        Parameters of all stages. A mapping such as ``{"walls.extension_m": 6}`` changes only those it names.
    sinks : sequence of Sink
        Your own outputs; each receives every step as it is made.
    on_snapshot : callable, optional
        Called with each finished `TrackedSnapshot` and the share of the log's time that is done.
    **options

    Returns
    -------
    Run
        The stored run.

    Raises
    ------
    LogError, InvalidMapError
        If the log cannot be read or holds no map that can be analyzed.
    ParameterError
        If an option or a parameter has a value that cannot be used.
    OutputError
        If there are results already and they may not be replaced, or one cannot be written.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> run = rl.analyze("sample_logs/office.mcap", max_snapshots=3)
    >>> run.snapshots.arrow["rooms"].to_pylist()
    [6, 12, 18]
    """
    log = _path(log, "log")
    folder = None if out is None else _path(out, "out")
    if folder is None:
        options = {"recording": False, "annotated_log": False, "journal": False} | options
    chosen = _options(parameters, options)
    if folder is not None:
        analyze_log(log, folder, chosen, on_snapshot, sinks)
        return Run(folder)
    temporary = TemporaryDirectory(prefix="rose2_logs_", ignore_cleanup_errors=True)
    folder = Path(temporary.name) / log_stem(log)
    try:
        analyze_log(log, folder, chosen, on_snapshot, sinks)
    except BaseException:
        temporary.cleanup()
        raise
    return Run(folder, temporary)


def track(
    log: str | Path | LogReader | Iterable[OccupancySnapshot],
    *,
    parameters: GivenParameters = None,
    method: str = "rose2",
    detail: float | None = None,
    workers: int = 1,
    topic: str | None = None,
) -> Iterator[TrackedSnapshot]:
    """Yield the maps of a log one after the other, each with its rooms and their identity over the run.

    Parameters
    ----------
    log : str, path, LogReader or iterable of OccupancySnapshot
        The log, or what `open_log` returns, or your own maps. Coverage refers to the last map; it is NaN for
        an iterator, whose last map is not known in advance.
    parameters : Parameters or mapping, optional
        As for `analyze`. What `open_log` returns, and its maps, are read by those that it was given: of
        ``reading``, ``mapping`` and ``occupancy`` there may be no others here.
    method : str
        The segmentation method.
    detail : float, optional
        As for `analyze`.
    workers : int
        Processes; what is yielded does not depend on it.
    topic : str, optional
        The map topic of a log that is given by its path; by default ``/map``, else the only one.

    Yields
    ------
    TrackedSnapshot
        Rooms, tracks, events, coverage. Maps that cannot be analyzed are left out with a warning.

    Raises
    ------
    LogError, InvalidMapError, ParameterError
        As `analyze`.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> for step in rl.track(rl.open_log("sample_logs/office.mcap", max_snapshots=3)):
    ...     print(f"{step.coverage:.2f}", len(step.rooms), sorted(step.track_ids)[:4])
    0.26 6 [1, 2, 3, 4]
    0.72 12 [1, 2, 4, 5]
    1.00 18 [1, 2, 4, 5]
    """
    # What cannot be used is refused by the call, not when the first map is asked for.
    options = _options(parameters, {"method": method, "detail": detail, "workers": workers, "topic": topic})
    if not isinstance(log, LogReader) and (not isinstance(log, Iterable) or isinstance(log, str | bytes)):
        return _tracked_and_closed(open_log(log, topic=topic, parameters=options.parameters), options)
    if topic is not None:
        raise ParameterError(f"topic={topic!r}: is for a log that is given by its path; give it to open_log")
    options = dataclasses.replace(options, parameters=with_maps(options.parameters, log))
    return _tracked(log, options) if isinstance(log, LogReader) else _own_tracked(log, options)


def _tracked_and_closed(reader: LogReader, options: RunOptions) -> Iterator[TrackedSnapshot]:
    with reader:
        yield from _tracked(reader, options)


def _tracked(reader: LogReader, options: RunOptions) -> Iterator[TrackedSnapshot]:
    tell_without_effect(options.parameters, *following(built=reader.is_built), method=options.method)
    with start_workers(options) as workers:
        yield from TrackedStream.of_log(reader, workers, options.parameters)


def _own_tracked(maps: Iterable[OccupancySnapshot], options: RunOptions) -> Iterator[TrackedSnapshot]:
    if not isinstance(maps, Sequence):
        maps = iter(maps)
        first = list(islice(maps, 1))
        maps = chain(first, maps)
        options = dataclasses.replace(options, parameters=with_maps(options.parameters, first))
    tell_without_effect(options.parameters, "tracking", method=options.method)
    with start_workers(options) as workers:
        yield from TrackedStream(*read_alike(maps, options.parameters), workers, options.parameters)


def segment(
    map_: ArrayLike | str | Path | OccupancySnapshot,
    *,
    resolution_m: float | None = None,
    method: str = "rose2",
    detail: float | None = None,
    parameters: GivenParameters = None,
    voronoi: bool = False,
) -> Segmentation:
    """Segment one map into rooms.

    Parameters
    ----------
    map_ : (H, W) array of int, str, path or OccupancySnapshot
        Occupancy in percent, -1 for unknown, row 0 at the origin as in ROS messages; or the file of a saved
        map. Of an array, and of a snapshot that no reader made, it is decided as of a log what the numbers
        mean (probabilities, 0 and 1, costs), with a warning where they are not the usual ones.
    resolution_m : float, optional
        Side of a cell in meters, for an array or an image without a ``.yaml`` next to it.
    method : str
        ``rose2``, or one of the classical methods ``morphological``, ``distance``, ``voronoi``.
    detail : float, optional
        As for `analyze`; `Segmentation.at_detail` changes it later.
    parameters : Parameters or mapping, optional
        As for `analyze`. A snapshot that `open_log` or `read_map` made is read already: there may be no
        others of ``occupancy`` than it was read by.
    voronoi : bool
        Whether to return the Voronoi graph as well.

    Returns
    -------
    Segmentation
        A `SnapshotAnalysis` (rooms, label image, walls, faces, clean map) that can be drawn.

    Raises
    ------
    InvalidMapError
        If the array is no occupancy grid, or the map cannot be read.
    ParameterError
        If the resolution is missing, or a parameter or the method cannot be used.

    Examples
    --------
    >>> import numpy as np, rose2_logs as rl
    >>> grid = np.full((120, 200), -1, np.int8)
    >>> grid[10:110, 10:190] = 0
    >>> grid[10:110, [10, 11, 99, 100, 188, 189]] = 100
    >>> grid[[10, 11, 108, 109], 10:190] = 100
    >>> grid[50:70, 99:101] = 0
    >>> rl.segment(grid, resolution_m=0.05).rooms
    RoomMap(2 rooms, 1 doorway, 200 x 120 cells of 0.05 m)
    """
    used = with_detail(Parameters.from_any(parameters), detail, method)
    if isinstance(map_, str | Path | bytes):
        snapshot = _read_map(map_, resolution_m, used)  # type: ignore[arg-type]
    elif isinstance(map_, OccupancySnapshot):
        if resolution_m is not None:
            raise ParameterError(
                f"an OccupancySnapshot says how large its cells are; leave out resolution_m={resolution_m!r}"
            )
        used = with_snapshot(used, map_)
        snapshot = in_percent(map_, decided_reading([map_], used.occupancy), used.occupancy)
    else:
        snapshot = snapshot_of_array(map_, resolution_m, used.occupancy)
    if not snapshot.cells.size:
        raise InvalidMapError("the map has no cells")
    read = ("reading",) if isinstance(map_, str | Path | bytes) else ()
    return segment_snapshot(snapshot, used, method, name=snapshot.topic, voronoi=voronoi, read=read)


def open_log(
    log: str | Path | Sequence[str | Path],
    *,
    topic: str | None = None,
    message_type: str | None = None,
    part: int | None = None,
    map_from: str | None = None,
    map_frame: str | None = None,
    parameters: GivenParameters = None,
    **selection: Any,
) -> LogReader:
    """Open a log to read its maps.

    Parameters
    ----------
    log : str, path, or a sequence of them
        An MCAP file, a ROS 1 bag, a ROS 2 bag, saved maps; or several files of one kind that are one log.
    topic : str, optional
        The map topic; by default ``/map``, else the only one.
    message_type : str, optional
        Type of the maps on channels without a schema.
    part : int, optional
        Which part of the maps to take alone, from 1; by default all where the map was begun anew, and where
        several nodes publish the one that tells most.
    map_from : str, optional
        Topic of laser scans to build the maps from, instead of reading recorded ones.
    map_frame : str, optional
        Frame of built maps; by default ``map``, else ``odom``.
    parameters : Parameters or mapping, optional
        Those of ``reading`` say how much a log may claim, those of ``occupancy`` what the cells mean, those
        of ``mapping`` how maps are built.
    **selection
        Fields of `Selection`: ``every_s``, ``min_change_m2``, ``max_snapshots`` and so on.

    Returns
    -------
    LogReader
        ``reader.snapshots()`` yields the maps; a context manager that closes the log.

    Raises
    ------
    LogError, NoMapTopicError, ParameterError
        If the log cannot be opened, has no map topic, or an argument cannot be used.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> with rl.open_log("sample_logs/wing.bag") as reader:
    ...     print(reader.topic, reader.first())
    /map OccupancySnapshot(index=0, topic='/map', 384 x 320 cells of 0.05 m)
    """
    known = [each.name for each in dataclasses.fields(Selection)]
    _refuse_unknown(selection, known)
    names = {"topic": topic, "message_type": message_type, "part": part}
    for name, value in (names | {"map_from": map_from, "map_frame": map_frame}).items():
        check_option(RunOptions, name, value)
    used = Parameters.from_any(parameters)
    path = [_path(each, "log") for each in log] if isinstance(log, list | tuple) else _path(log, "log")
    return open_log_reader(
        path,
        topic=topic,
        selection=Selection(**selection),
        limits=used.reading.with_type(message_type),
        occupancy=used.occupancy,
        part=part,
        map_from=map_from,
        map_frame=map_frame,
        mapping=used.mapping,
    )


def map_topics(log: str | Path | Sequence[str | Path], *, message_type: str | None = None) -> list[str]:
    """List the topics of a log that hold maps, to analyze one after the other.

    Parameters
    ----------
    log : str, path, or a sequence of them
        As for `open_log`.
    message_type : str, optional
        Type of the maps on channels without a schema.

    Raises
    ------
    LogError, NoMapTopicError, ParameterError
        As for `open_log`.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> log = "sample_logs/office.mcap"
    >>> {topic: rl.analyze(log, topic=topic, max_snapshots=2) for topic in rl.map_topics(log)}
    {'/map': <Run office: 2 maps, 18 rooms at the end>}
    """
    check_option(RunOptions, "message_type", message_type)
    path = [_path(each, "log") for each in log] if isinstance(log, list | tuple) else _path(log, "log")
    return map_topics_of_log(path, Parameters().reading.with_type(message_type))


def read_map(
    map_file: str | Path, resolution_m: float | None = None, parameters: GivenParameters = None
) -> OccupancySnapshot:
    """Read a saved map.

    Parameters
    ----------
    map_file : str or path
        A map_server ``.yaml``, or an image in the gray values of ROS maps.
    resolution_m : float, optional
        Side of a cell in meters, for an image without a ``.yaml`` next to it.
    parameters : Parameters or mapping, optional
        As for `analyze`; those of ``reading`` and ``occupancy`` count.

    Raises
    ------
    LogError, InvalidMapError, ParameterError
        If it cannot be read, is a log, or its resolution is not known.

    Examples
    --------
    >>> import tempfile, numpy as np, rose2_logs as rl
    >>> from PIL import Image
    >>> image = np.full((120, 200), 205, np.uint8)
    >>> image[10:110, 10:190] = 254
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     Image.fromarray(image).save(f"{folder}/plan.png")
    ...     rl.read_map(f"{folder}/plan.png", resolution_m=0.05)
    OccupancySnapshot(index=0, topic='/map', 200 x 120 cells of 0.05 m)
    """
    return _read_map(map_file, resolution_m, Parameters.from_any(parameters))


def _read_map(map_file: str | Path, resolution_m: float | None, parameters: Parameters) -> OccupancySnapshot:
    return read_static_map(_path(map_file, "map_file"), _resolution(resolution_m), parameters)


def load(folder: str | Path, *, part: int | None = None) -> Run:
    """Open the results of a run.

    Parameters
    ----------
    folder : str or path
        The folder that `analyze` or the command line wrote for one log.
    part : int, optional
        Take one part alone, of a log in which the map was begun anew; `Run.parts` lists them.

    Raises
    ------
    ResultsError
        If the folder holds no results, or those of another version.
    ParameterError
        If there is no such part.

    Examples
    --------
    >>> import tempfile, rose2_logs as rl
    >>> options = {"max_snapshots": 3, "recording": False, "annotated_log": False}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = rl.analyze("sample_logs/office.mcap", f"{folder}/office", **options)
    ...     rl.load(f"{folder}/office")
    <Run office: 3 maps, 18 rooms at the end>
    """
    return Run(_path(folder, "folder"), part=part)


def compare(
    a: Run | str | Path,
    b: Run | str | Path,
    out: str | Path | None = None,
    *,
    parameters: GivenParameters = None,
    overwrite: bool = False,
) -> LayoutComparison:
    """Align the last layout of run B with that of run A, wherever they started, and find what differs.

    Parameters
    ----------
    a, b : Run, str or path
        The runs, or the folders of their results; ``load(folder, part=1)`` takes a part of a run.
    out : str or path, optional
        Folder for tables, a picture and a recording of the comparison.
    parameters : Parameters or mapping, optional
        Of the comparison, as in `analyze`.
    overwrite : bool
        Whether an earlier comparison may be replaced.

    Returns
    -------
    LayoutComparison
        Where B is in A's frame, and which rooms and walls are the same, new, missing, moved or not explored.

    Raises
    ------
    ResultsError
        If results cannot be read, or a last map has too few walls to be aligned.
    OutputError
        If the folder is that of a run, there is a comparison already and it may not be replaced, or a file
        cannot be written.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> run = rl.analyze("sample_logs/office.mcap", max_snapshots=3)
    >>> rl.compare(run, run).room_counts
    {'same': 18}
    """
    run_a, run_b = (each if isinstance(each, Run) else Run(_path(each, "run")) for each in (a, b))
    used = Parameters.from_any(parameters)
    if out is None:
        return compare_stored(run_a, run_b, parameters=used)
    return compare_runs(run_a, run_b, _path(out, "out"), overwrite=overwrite, parameters=used).comparison


def evaluate(
    cases: str | Path,
    *,
    method: str = "rose2",
    detail: float | None = None,
    parameters: GivenParameters = None,
    group: str | None = None,
    along: bool = False,
    workers: int = 1,
) -> Evaluation:
    """Segment maps whose true rooms are known, and measure how well the found rooms agree with them.

    Where a map has two truths, the one that agrees better counts.

    Parameters
    ----------
    cases : str or path
        A JSON file that lists the maps with their true rooms, see `rose2_logs.evaluation.cases`.
    method : str
        The segmentation method.
    detail : float, optional
        As for `analyze`.
    parameters : Parameters or mapping, optional
        As for `analyze`.
    group : str, optional
        Evaluate only the cases of this group.
    along : bool
        Whether the cases of each group are, in their order, the maps of one run: this
        adds figures over its coverage and of its tracks.
    workers : int
        Processes; results do not depend on it.

    Returns
    -------
    Evaluation
        Figures of each map (``maps``), with the truth that counted, and means of each group (``groups``).

    Raises
    ------
    CasesError
        If the list or an image cannot be read, or the images of a case differ in size.
    ParameterError
        If a parameter, the method or the number of workers cannot be used.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> found = rl.evaluate("../shared/benchmark/cases.json", group="campus")  # doctest: +SKIP
    >>> found.groups["campus"].iou_sym  # doctest: +SKIP
    """
    return evaluate_method(
        _path(cases, "cases"),
        method=method,
        parameters=with_detail(Parameters.from_any(parameters), detail, method),
        group=group,
        along=along,
        workers=workers,
    )


def _options(parameters: GivenParameters, options: Mapping[str, Any]) -> RunOptions:
    """Make the options of a run, of keywords that people give."""
    _refuse_unknown(
        options, [each.name for each in dataclasses.fields(RunOptions) if each.name != "parameters"]
    )
    return RunOptions(parameters=Parameters.from_any(parameters), **options)


def _refuse_unknown(options: Mapping[str, Any], known: Sequence[str]) -> None:
    if unknown := [name for name in options if name not in known]:
        meant = difflib.get_close_matches(unknown[0], known, 1)
        hint = f"did you mean {meant[0]!r}?" if meant else f"there are: {', '.join(known)}"
        raise ParameterError(f"no option {unknown[0]!r}; {hint}")


def _path(given: Any, name: str) -> Path:
    """Return what was given as a path, from the home folder behind ``~/``; all else is refused."""
    if not isinstance(given, str | os.PathLike):
        raise ParameterError(f"{name} must be a str or a Path, not {_type(given)}")
    if not os.fspath(given):
        raise ParameterError(f"{name} is an empty text; '.' is the current folder")
    path = expanded(Path(given))
    require_local(path)
    return path


def _resolution(given: Any) -> float | None:
    """Return a resolution as a float; what is no number is refused."""
    if given is None:
        return None
    with suppress(OverflowError):
        if isinstance(given, Real) and given is not True and given is not False:
            return float(given)
    raise ParameterError(f"resolution_m={given!r}: it must be a number, in meters")


def _type(given: object) -> str:
    return type(given).__name__

"""The layout of one map of a run, drawn or written for other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rose2_logs.drawing.drawing import ENDINGS
from rose2_logs.errors import ParameterError
from rose2_logs.outputs.exports.formats import planned_files, write_plan
from rose2_logs.runs.run import Run, named_run
from rose2_logs.system.files import refuse_existing
from rose2_logs.workflows import FIGURE_WIDTH_PX


def write_figure(
    folder: Path,
    out: Path | None = None,
    snapshot: int | None = None,
    coverage: float | None = None,
    *,
    back_projected: bool = False,
    width_px: int = FIGURE_WIDTH_PX,
    overwrite: bool = False,
    names: Path | None = None,
    part: int | None = None,
) -> Path:
    """Draw the layout of a map.

    Parameters
    ----------
    folder : path
        Results of a log.
    out : path, optional
        The picture, ``.png`` or ``.svg``; by default ``<name>.figure.png`` in the folder, with the number of
        a part that is named, the number of the map if it is not the last, and ``back_projected`` if it is.
    snapshot, coverage : int, float, optional
        Which map, see `Run.choose`.
    back_projected : bool
        Draw the rooms of the last map as far as this one shows them, instead of the rooms found in it.
    width_px : int
        Width of a PNG.
    overwrite : bool
        Whether a picture may be replaced.
    names : path, optional
        Other names for rooms, see `Run.rename`.
    part : int, optional
        The part that the map is chosen from, of a run in which maps were begun anew; by default the last.

    Returns
    -------
    path
        The picture.

    Raises
    ------
    LogError
        If the results cannot be read.
    ParameterError
        If there is no such map or part, or the picture would be of another kind.
    OutputError
        If the picture exists and may not be replaced, or cannot be written.
    """
    results = named_run(folder, names, part)
    number = results.choose(snapshot, coverage)
    stem = f"{_stem(results, number)}.back_projected" if back_projected else _stem(results, number)
    out = folder / f"{stem}.figure.png" if out is None else out
    if out.suffix.lower() not in ENDINGS:
        raise ParameterError(f"{out}: a figure is {' or '.join(ENDINGS)}; let its name end so")
    refuse_existing([out], overwrite=overwrite)
    return results.figure(number, back_projected=back_projected).save(out, width_px)


def export_plan(
    folder: Path,
    formats: Sequence[str],
    out: Path | None = None,
    snapshot: int | None = None,
    coverage: float | None = None,
    *,
    overwrite: bool = False,
    names: Path | None = None,
    part: int | None = None,
) -> list[Path]:
    """Write the floor plan of a map for other programs.

    Parameters
    ----------
    folder : path
        Results of a log.
    formats : sequence of str
        Names among `exports.formats.FORMATS`.
    out : path, optional
        Folder for the files; by default that of the results.
    snapshot, coverage : int, float, optional
        Which map, see `Run.choose`; its number stands in the files' names if it is not the last.
    overwrite : bool
        Whether files may be replaced.
    names : path, optional
        Other names for rooms, see `Run.rename`.
    part : int, optional
        As for `write_figure`; its number stands in the files' names.

    Returns
    -------
    list of path
        The files.

    Raises
    ------
    LogError, ParameterError, OutputError
        As `write_figure`, or if there is no such format.
    """
    results = named_run(folder, names, part)
    number = results.choose(snapshot, coverage)
    out = folder if out is None else out
    stem = _stem(results, number)
    refuse_existing(planned_files(formats, out, stem), overwrite=overwrite)
    return write_plan(results.plan(number, with_walls=True), formats, out, stem)


def _stem(results: Run, number: int) -> str:
    """Beginning of the files' names: the log, the part if one is named, the map unless it is the last."""
    stem = results.name if results.part is None else f"{results.name}.part{results.part}"
    return stem if number == results.choose() else f"{stem}.snapshot{number}"

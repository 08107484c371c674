"""Two folders of results to what differs between their last layouts: tables, summary, picture, recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rose2_logs.comparison.layouts import LayoutComparison, compare_layouts
from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import OutputError, ResultsError
from rose2_logs.runs.last_layout import read_final_layout
from rose2_logs.runs.run import Run
from rose2_logs.runs.summary import SUMMARY
from rose2_logs.system.files import refuse_existing, writing
from rose2_logs.workflows.without_effect import COMPARING, tell_without_effect

FILES = (
    "room_changes.parquet",
    "wall_changes.parquet",
    "comparison.json",
    "comparison.png",
    "comparison.html",
    "comparison.rrd",
)


@dataclass(frozen=True)
class ComparisonResult:
    """What `compare_runs` found and wrote."""

    comparison: LayoutComparison
    folder: Path
    files: tuple[Path, ...]


def compare_runs(
    run_a: Run,
    run_b: Run,
    folder: Path,
    *,
    recording: bool = True,
    overwrite: bool = False,
    parameters: Parameters | None = None,
) -> ComparisonResult:
    """Compare the last layouts of two runs and write what differs.

    Parameters
    ----------
    run_a, run_b : Run
        The stored runs, or parts of them; B is laid over A.
    folder : path
        Receives the files of `FILES`.
    recording : bool
        Whether to write the Rerun recording.
    overwrite : bool
        Whether an earlier comparison may be replaced.
    parameters : Parameters, optional
        Of the comparison.

    Raises
    ------
    ResultsError
        If results cannot be read, or the last map of a run has too few walls to be aligned.
    OutputError
        If the folder is that of a run, there is a comparison already and it may not be replaced, or a file
        cannot be written.
    """
    from rose2_logs.drawing.comparison_picture import draw_comparison
    from rose2_logs.outputs.comparison_tables import write_comparison_summary, write_comparison_tables
    from rose2_logs.outputs.report.comparison import comparison_page
    from rose2_logs.outputs.report.page import write_page

    if (folder / SUMMARY).is_file():
        raise OutputError(f"{folder}: holds the results of a run; write the comparison to another folder")
    files = tuple(folder / name for name in FILES)
    refuse_existing(files, overwrite=overwrite)
    comparison = compare_stored(run_a, run_b, *_names(run_a, run_b), parameters)
    write_comparison_tables(files[0], files[1], comparison)
    write_comparison_summary(files[2], comparison, run_a, run_b)
    drawing = draw_comparison(comparison)
    drawing.save(files[3], width_px=None)
    write_page(files[4], comparison_page(comparison, drawing))
    if recording:
        from rose2_logs.outputs.rerun.comparison import write_comparison_recording

        write_comparison_recording(files[5], comparison)
        return ComparisonResult(comparison, folder, files)
    with writing(files[5]):
        files[5].unlink(missing_ok=True)  # of the comparison that this one replaces
    return ComparisonResult(comparison, folder, files[:-1])


def compare_stored(
    run_a: Run,
    run_b: Run,
    name_a: str | None = None,
    name_b: str | None = None,
    parameters: Parameters | None = None,
) -> LayoutComparison:
    """Compare the last layouts of two stored runs; B is laid over A.

    Parameters
    ----------
    run_a, run_b : Run
        The runs.
    name_a, name_b : str, optional
        What they are called instead of by their own names.
    parameters : Parameters, optional
        Of the comparison.

    Raises
    ------
    ResultsError
        If results cannot be read, or a last map has too few walls to be aligned.
    """
    if parameters is not None:
        tell_without_effect(parameters, *COMPARING)
    a = read_final_layout(run_a, name_a, parameters)
    b = read_final_layout(run_b, name_b, parameters)
    comparison = compare_layouts(a, b)
    if comparison is None:
        few = run_a if not a.map.can_be_placed else run_b
        raise ResultsError(f"{few.folder}: the last map has too few walls to be aligned with another")
    return comparison


def _names(run_a: Run, run_b: Run) -> tuple[str, str]:
    """Name two runs by the shortest ends of their folders' paths that differ, and their parts."""
    name_a, name_b = _ends_that_differ(run_a.folder.resolve().parts, run_b.folder.resolve().parts)
    return (
        name_a if run_a.part is None else f"{name_a}, part {run_a.part}",
        name_b if run_b.part is None else f"{name_b}, part {run_b.part}",
    )


def _ends_that_differ(a: Sequence[str], b: Sequence[str]) -> tuple[str, str]:
    for count in range(1, max(len(a), len(b))):
        if a[-count:] != b[-count:]:
            return "/".join(a[-count:]), "/".join(b[-count:])
    return a[-1], b[-1]

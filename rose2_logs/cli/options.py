"""What several commands share: options, exit codes, parameters from the options."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rose2_logs.errors import ParameterError

if TYPE_CHECKING:
    from rose2_logs.config.parameters import Parameters

EXIT_FAULT, EXIT_KNOWN, EXIT_INTERRUPTED = 1, 2, 130

EXIT_CODES = (
    "[bold]Exit codes:[/bold] 0 done, also with warnings, which summary.json counts; 1 a fault of "
    "rose2-logs itself; 2 a log, a file or an option cannot be used, or with --strict a warning, and one "
    "line says which; 130 interrupted."
)

state = {"debug": False}
"""What the options that every command takes have set."""


def _set_debug(value: bool) -> None:
    state["debug"] = value or state["debug"]


Debug = Annotated[
    bool, typer.Option("--debug", help="Show the traceback of errors.", callback=_set_debug, is_eager=True)
]
Workers = Annotated[int, typer.Option(min=1, help="Processes; results do not depend on their number.")]
Topic = Annotated[
    str | None, typer.Option(help="Map topic; by default /map, else the only one.", show_default=False)
]
Start = Annotated[
    float | None, typer.Option(metavar="S", help="Skip this many seconds of the log.", show_default=False)
]
End = Annotated[
    float | None, typer.Option(metavar="S", help="Stop this many seconds into the log.", show_default=False)
]
Every = Annotated[
    float | None, typer.Option(metavar="S", help="Least seconds between maps.", show_default=False)
]
MinChange = Annotated[
    float | None,
    typer.Option(metavar="M2", help="Least newly known area between maps.", show_default=False),
]
MaxSnapshots = Annotated[
    int | None, typer.Option(metavar="N", help="Most maps, spread evenly.", show_default=False)
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what an earlier call has written.")]
Resume = Annotated[
    bool,
    typer.Option(
        "--resume",
        help="Go on after the last map of a run of the same log and parameters that was stopped; "
        "results that are whole stay as they are.",
    ),
]
NoRecording = Annotated[bool, typer.Option("--no-rrd", help="Write no Rerun recording.")]
Layers = Annotated[
    str,
    typer.Option(
        metavar="NAMES",
        help="What the recording gets besides map, rooms and doorways: all, none, or some of "
        "predicted, path, clean_map, score, spectrum, segments, lines, faces, voronoi, between commas.",
    ),
]
NoAnnotatedLog = Annotated[bool, typer.Option("--no-mcap", help="Write no annotated MCAP.")]
Bag = Annotated[
    bool,
    typer.Option(
        "--bag", help="Also write metadata.yaml: `ros2 bag play` of the folder then plays the annotated MCAP."
    ),
]
Method = Annotated[str, typer.Option(help="Segmentation: rose2, morphological, distance or voronoi.")]
Strict = Annotated[
    bool,
    typer.Option(
        "--strict",
        help="Take the first warning about the log as an error; by default what is whole is analyzed.",
    ),
]
Smooth = Annotated[
    bool,
    typer.Option(
        "--back-project",
        help="Read the maps once more in the end and tell how much of each of the last map's rooms every "
        "map shows: back_projected.parquet, a tab in the recording, a section in the report.",
    ),
]
Config = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.toml",
        help="Parameters, one table per stage: as in the summary.json of a run.",
        show_default=False,
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="STAGE.NAME=VALUE",
        help="Change one parameter, as in walls.extension_m=6; may be repeated. The summary.json of a run "
        "lists all.",
        show_default=False,
    ),
]


def wanted_bag(bag: bool, no_mcap: bool) -> bool:
    """Check that what is to become a bag is written.

    Raises
    ------
    ParameterError
        If it is not.
    """
    if bag and no_mcap:
        raise ParameterError("--bag is about the annotated MCAP: leave --no-mcap out")
    return bag


def chosen_layers(names: str) -> tuple[str, ...]:
    """Read which layers of a recording were asked for: all, none, or names between commas.

    Raises
    ------
    ParameterError
        If there is no such layer.
    """
    from rose2_logs.config.run_options import RECORDING_LAYERS

    if names in ("all", "none"):
        return RECORDING_LAYERS if names == "all" else ()
    asked = [name.strip() for name in names.split(",")]
    if unknown := [name for name in asked if name not in RECORDING_LAYERS]:
        raise ParameterError(
            f"--layers: there is no layer {unknown[0]!r}; there are: all, none, {', '.join(RECORDING_LAYERS)}"
        )
    return tuple(name for name in RECORDING_LAYERS if name in asked)


def resolve_parameters(config: Path | None, settings: list[str] | None, method: str = "rose2") -> Parameters:
    """Read the parameters and check the method that were asked for.

    Raises
    ------
    ParameterError
        If there is no such method or parameter, or a value cannot be used.
    """
    from rose2_logs.config.parameters import load_parameters
    from rose2_logs.segmentation.pipeline import METHODS

    if method not in METHODS:
        raise ParameterError(f"no method {method!r}; there are: {', '.join(METHODS)}")
    return load_parameters(config, settings or ())

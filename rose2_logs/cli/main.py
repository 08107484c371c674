"""The command line ``rose2-logs``: arguments in, one call, a report out."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from rose2_logs import __version__
from rose2_logs.cli import batch as cli_batch
from rose2_logs.cli import compare as cli_compare
from rose2_logs.cli import results as cli_results
from rose2_logs.cli.app import App
from rose2_logs.cli.options import (
    EXIT_CODES,
    EXIT_FAULT,
    EXIT_INTERRUPTED,
    EXIT_KNOWN,
    Bag,
    Config,
    Debug,
    End,
    Every,
    Layers,
    MaxSnapshots,
    Method,
    MinChange,
    NoAnnotatedLog,
    NoRecording,
    Resume,
    Settings,
    Smooth,
    Start,
    Strict,
    Topic,
    Workers,
    chosen_layers,
    resolve_parameters,
    state,
    wanted_bag,
)
from rose2_logs.errors import AlreadyWholeError, ParameterError, Rose2LogsError

app = App(
    name="rose2-logs",
    help="Rooms and structure of buildings from the maps in robot logs.\n\n"
    "Begin with [bold]rose2-logs analyze run.mcap -o results[/bold]; then "
    "[bold]rose2-logs view results/run[/bold] shows what was found, and "
    "[bold]rose2-logs report results/run[/bold] makes a page of it.",
    epilog=EXIT_CODES,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Run the command line and exit."""
    from rose2_logs.cli import messages

    state["debug"] = False
    try:
        app()
    except Rose2LogsError as error:
        _show(error)
        sys.exit(EXIT_KNOWN)
    except SystemExit as ended:
        # Typer ends so, without a word, upon Ctrl-C.
        if ended.code == EXIT_INTERRUPTED:
            messages.error("interrupted; unfinished results were removed")
        raise
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        messages.error(f"{where}{error.strerror or error}", debug=state["debug"], file=error.filename)
        sys.exit(EXIT_KNOWN)
    except MemoryError:
        text = "out of memory; use fewer --workers, or a lower --set reading.map_max_cells"
        messages.error(text, debug=state["debug"])
        sys.exit(EXIT_KNOWN)
    except Exception as error:
        if state["debug"]:
            raise
        messages.error(f"{type(error).__name__}: {error} (a fault of rose2-logs: --debug shows where)")
        sys.exit(EXIT_FAULT)


def _show(error: Rose2LogsError) -> None:
    from rose2_logs.cli import messages

    messages.error(str(error), debug=state["debug"], file=error.file, topic=error.topic, index=error.index)


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"rose2-logs {__version__}")
        raise typer.Exit


@app.callback()
def _everything(
    debug: Debug = False,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, metavar="", help="Show the version."
        ),
    ] = False,
) -> None:
    from rose2_logs.cli.messages import show_messages

    show_messages()


@app.command(epilog="Example: [bold]rose2-logs info run.mcap[/bold]")
def info(
    log: Annotated[
        str, typer.Argument(metavar="LOG", help="MCAP, ROS 1 bag, ROS 2 bag, saved map or folder of such.")
    ],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for scripts.")] = False,
    config: Config = None,
    settings: Settings = None,
    debug: Debug = False,
) -> None:
    """Show what a log holds: topics, map sizes, resolution, duration, coverage."""
    from rose2_logs.cli import printing as reporting
    from rose2_logs.workflows.info import describe_log

    facts = describe_log(log, resolve_parameters(config, settings))
    if as_json:
        reporting.print_json(facts.as_json())
    else:
        reporting.print_log_facts(facts)


@app.command(epilog="Example: [bold]rose2-logs analyze run.mcap -o results --workers 4[/bold]")
def analyze(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG", help="One or several logs.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Results go to OUT/<name of the log>/.")],
    topic: Topic = None,
    start: Start = None,
    end: End = None,
    every: Every = None,
    min_change: MinChange = None,
    max_snapshots: MaxSnapshots = None,
    workers: Workers = 1,
    method: Method = "rose2",
    config: Config = None,
    settings: Settings = None,
    live: Annotated[
        bool, typer.Option("--live", help="Also show it in a Rerun viewer; one is started if none is open.")
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace results of an earlier run.")
    ] = False,
    resume: Resume = False,
    no_rrd: NoRecording = False,
    no_mcap: NoAnnotatedLog = False,
    strict: Strict = False,
    layers: Layers = "all",
    back_project: Smooth = False,
    bag: Bag = False,
    debug: Debug = False,
) -> None:
    """Find and follow the rooms in all maps of a log; write recording, annotated MCAP and tables."""
    from rose2_logs.cli import printing as reporting
    from rose2_logs.config.selection import Selection
    from rose2_logs.system.workers import keep_freed_memory
    from rose2_logs.workflows.analyze import RunOptions, analyze_log, log_stem, seconds_into_log

    keep_freed_memory()
    parameters = resolve_parameters(config, settings, method)
    shown = chosen_layers(layers)
    names = [log_stem(log) for log in logs]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ParameterError(f"several logs are named {min(twice)}: analyze them to different folders")
    failed = False
    for log, name in zip(logs, names, strict=True):
        try:
            start_ns, end_ns = seconds_into_log(log, start, end, parameters.reading)
            options = RunOptions(
                topic=topic,
                selection=Selection(start_ns, end_ns, every, min_change, max_snapshots),
                parameters=parameters,
                method=method,
                workers=workers,
                recording=not no_rrd,
                layers=shown,
                annotated_log=not no_mcap,
                bag=wanted_bag(bag, no_mcap),
                back_project=back_project,
                live=live,
                overwrite=overwrite,
                strict=strict,
                resume=resume,
            )
            with reporting.run_progress(name) as on_snapshot:
                result = analyze_log(log, out / name, options, on_snapshot)
            reporting.print_run(result)
        except AlreadyWholeError as whole:
            reporting.print_text(str(whole))
        except Rose2LogsError as error:
            if len(logs) == 1:
                raise
            failed = True
            _show(error)
    if failed:
        raise typer.Exit(EXIT_KNOWN)


app.command(epilog=cli_batch.BATCH_EXAMPLE)(cli_batch.batch)


@app.command(
    epilog="Example: [bold]rose2-logs view results/run[/bold]; on a machine without a screen, "
    "[bold]rose2-logs view results/run --web[/bold]"
)
def view(
    recording: Annotated[
        str,
        typer.Argument(
            metavar="FILE.rrd",
            help="Recording that analyze wrote, or its folder, or the address that serve printed.",
        ),
    ],
    web: Annotated[bool, typer.Option("--web", help="In the browser, served on 127.0.0.1.")] = False,
    port: Annotated[
        int | None,
        typer.Option(min=1, max=65535, help="With --web: port of the page.", show_default=False),
    ] = None,
    debug: Debug = False,
) -> None:
    """Open a recording in the Rerun viewer."""
    from rose2_logs.cli import printing as reporting
    from rose2_logs.outputs.rerun import viewer as rerun_viewer

    if "://" not in recording:
        recording = str(rerun_viewer.find_recording(Path(recording)))
    if not web:
        raise typer.Exit(rerun_viewer.show(recording))
    with rerun_viewer.served_page(recording, port) as (url, server):
        reporting.print_line(f"{url} shows it until Ctrl-C is pressed")
        if rerun_viewer.has_screen():
            typer.launch(url)
        with suppress(KeyboardInterrupt):
            server.wait()


app.command(epilog=cli_batch.SERVE_EXAMPLE)(cli_batch.serve)
app.command(epilog=cli_results.REPORT_EXAMPLE)(cli_results.report)
app.command(epilog=cli_results.FIGURE_EXAMPLE)(cli_results.figure)
app.command(epilog=cli_results.EXPORT_EXAMPLE)(cli_results.export)


app.command(epilog=cli_compare.EXAMPLE)(cli_compare.compare)


@app.command(epilog="Example: [bold]rose2-logs segment map.png --resolution 0.05 -o rooms[/bold]")
def segment(
    map_file: Annotated[Path, typer.Argument(metavar="MAP", help="map_server .yaml, or a .png or .pgm.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")],
    resolution: Annotated[
        float | None,
        typer.Option(metavar="M", help="Side of a cell, for an image without .yaml.", show_default=False),
    ] = None,
    formats: Annotated[
        list[str] | None,
        typer.Option(
            "--format",
            metavar="FORMAT",
            help="Also write svg, dxf, map_server or graph, as export does; may be repeated.",
            show_default=False,
        ),
    ] = None,
    method: Method = "rose2",
    config: Config = None,
    settings: Settings = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace earlier results.")] = False,
    debug: Debug = False,
) -> None:
    """Segment one map: label image, floor plan as GeoJSON, picture."""
    from rose2_logs.cli import printing as reporting
    from rose2_logs.workflows.segment import segment_map

    parameters = resolve_parameters(config, settings, method)
    result = segment_map(
        map_file, out, parameters, method, formats=formats or (), resolution_m=resolution, overwrite=overwrite
    )
    reporting.print_static_map(result)


@app.command(
    epilog="Example: [bold]rose2-logs evaluate cases.json --pictures pictures --json figures.json[/bold]"
)
def evaluate(
    cases: Annotated[
        Path,
        typer.Argument(
            metavar="CASES.json",
            help="Maps with true rooms: "
            '{"cases": \\[{"group", "name", "map", "rooms", "resolution_m"}, ..]}, '
            "where map and rooms name images of one size.",
        ),
    ],
    predictions: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write DIR/<group>/<name>.png label images.", show_default=False),
    ] = None,
    pictures: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Draw DIR/<group>/<name>.png: map, true rooms, found rooms, errors; and contact sheets.",
            show_default=False,
        ),
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the figures.", show_default=False)
    ] = None,
    group: Annotated[
        str | None, typer.Option(help="Only the cases of one group.", show_default=False)
    ] = None,
    along: Annotated[
        bool,
        typer.Option(
            "--along",
            help="Take each group's cases, in their order, as the maps of one run: figures over coverage, "
            "the free area over that of the group's last map, and of the tracks: IDF1, switches, "
            "fragmentations. With --pictures also as DIR/<group>.along.png.",
        ),
    ] = False,
    workers: Workers = 1,
    method: Method = "rose2",
    config: Config = None,
    settings: Settings = None,
    debug: Debug = False,
) -> None:
    """Segment maps whose true rooms are known and print the figures."""
    from contextlib import nullcontext

    from rose2_logs.cli import printing as reporting
    from rose2_logs.drawing.case_pictures import CasePictures
    from rose2_logs.drawing.curves import draw_along
    from rose2_logs.drawing.image_files import write_image, write_label_image
    from rose2_logs.evaluation.along import along_as_json, along_runs
    from rose2_logs.evaluation.benchmark import evaluate_cases, figures
    from rose2_logs.evaluation.cases import load_cases
    from rose2_logs.evaluation.run_tracks import RunTracks, run_tracks_as_json
    from rose2_logs.runs.summary import write_json
    from rose2_logs.system.workers import keep_freed_memory

    keep_freed_memory()
    parameters = resolve_parameters(config, settings, method)
    chosen = load_cases(cases, group)
    results = []
    tracks = RunTracks(parameters)
    drawn = CasePictures(pictures) if pictures is not None else nullcontext()
    with drawn as drawer, reporting.case_progress(len(chosen)) as advance:
        for result in evaluate_cases(chosen, method, parameters, workers):
            if predictions is not None:
                write_label_image(predictions / result.case.group / f"{result.case.name}.png", result.labels)
            if drawer is not None:
                drawer.add(result)
            if along:
                tracks.add(result)
            results.append(result.without_labels())
            advance(result.case.name)
    runs = along_runs(results) if along else {}
    if json_file is not None:
        found = figures(results)
        if along:
            found |= {"along": along_as_json(runs), "tracks": run_tracks_as_json(tracks.scores())}
        write_json(json_file, {"method": method, "parameters": parameters.resolved(), **found})
    if pictures is not None:
        for name, points in runs.items():
            write_image(pictures / f"{name}.along.png", draw_along(f"{name}, {method}", points))
    if along:
        reporting.print_along(runs)
        reporting.print_tracks(tracks.scores())
    else:
        reporting.print_figures(results)

"""The commands for many logs: ``batch`` and ``serve``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rose2_logs.cli.options import (
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
    Settings,
    Smooth,
    Start,
    Strict,
    Topic,
    chosen_layers,
    resolve_parameters,
    state,
    wanted_bag,
)

BATCH_EXAMPLE = (
    "Example: [bold]rose2-logs batch /data/robots 'old/*.bag' -o results --workers 8[/bold]\n\n"
    "On a cluster: [bold]dask scheduler[/bold] on one machine prints its address, "
    "[bold]dask worker tcp://HOST:8786 --nworkers 8 --nthreads 1[/bold] on each, then "
    "[bold]rose2-logs batch /data/robots -o /data/results --scheduler tcp://HOST:8786[/bold]\n\n"
    "The same command again goes on where it was stopped, and takes up logs that are new."
)
CATALOG_PORT = 51234
"""Where Rerun's catalog servers listen unless told otherwise."""
SERVE_EXAMPLE = (
    "Example: [bold]rose2-logs serve results[/bold], then [bold]rose2-logs view "
    f"rerun+http://127.0.0.1:{CATALOG_PORT}[/bold]"
)


def batch(
    logs: Annotated[
        list[str],
        typer.Argument(
            metavar="LOG",
            help="Logs, folders at any depth, quoted patterns, URLs (s3://, https:// ..) of these.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            help="Results go to OUT/logs/NAME/, all tables to OUT/tables/, one line a log to OUT/summary.",
        ),
    ],
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Logs at a time on this machine; by default one for each processor.",
            show_default=False,
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Work on the Dask cluster of this scheduler (or scheduler file). Its workers must "
            "see OUT and local logs at the same paths.",
            show_default=False,
        ),
    ] = None,
    retries: Annotated[
        int, typer.Option(min=0, help="More tries after a lost worker or a fault of storage or network.")
    ] = 2,
    topic: Topic = None,
    start: Start = None,
    end: End = None,
    every: Every = None,
    min_change: MinChange = None,
    max_snapshots: MaxSnapshots = None,
    method: Method = "rose2",
    config: Config = None,
    settings: Settings = None,
    overwrite: Annotated[
        bool,
        typer.Option(
            "--overwrite", help="Replace results of other parameters and of logs that have changed."
        ),
    ] = False,
    rerun: Annotated[
        bool, typer.Option("--rerun", help="Analyze also the logs whose results are up to date.")
    ] = False,
    no_rrd: NoRecording = False,
    no_mcap: NoAnnotatedLog = False,
    strict: Strict = False,
    layers: Layers = "all",
    back_project: Smooth = False,
    bag: Bag = False,
    debug: Debug = False,
) -> None:
    """Analyze many logs, each to a folder of its own; one data set and one summary of all."""
    from rose2_logs.batch.driver import BatchOptions, run_batch
    from rose2_logs.batch.record import BatchSettings
    from rose2_logs.cli import printing_batch as reporting_batch

    asked = BatchSettings(
        topic=topic,
        start_s=start,
        end_s=end,
        every_s=every,
        min_change_m2=min_change,
        max_snapshots=max_snapshots,
        parameters=resolve_parameters(config, settings, method),
        method=method,
        recording=not no_rrd,
        annotated_log=not no_mcap,
        layers=chosen_layers(layers),
        back_project=back_project,
        bag=wanted_bag(bag, no_mcap),
        strict=strict,
    )
    options = BatchOptions(asked, workers, scheduler, retries, overwrite, rerun)
    with reporting_batch.BatchDisplay(debug=state["debug"]) as display:
        result = run_batch(logs, out, options, display)
    reporting_batch.print_batch(result)
    if result.failed:
        raise typer.Exit(EXIT_KNOWN)


def serve(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Results of batch or analyze.")],
    host: Annotated[
        str,
        typer.Option(help="Address to listen on; 0.0.0.0 lets other machines in, without a password."),
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0 for any.")] = CATALOG_PORT,
    debug: Debug = False,
) -> None:
    """Serve the recordings of all logs as one Rerun catalog, until Ctrl-C."""
    import threading

    from rose2_logs.cli import printing as reporting
    from rose2_logs.outputs.rerun.catalog import serve_recordings

    with serve_recordings(folder, host, port) as (url, count):
        try:
            reporting.print_line(
                f"{count} recordings at [bold]{url}[/]; open them with [bold]rose2-logs view {url}[/]"
            )
            reporting.print_line("Ctrl-C ends the server")
            threading.Event().wait()
        except KeyboardInterrupt:
            raise typer.Exit(0) from None

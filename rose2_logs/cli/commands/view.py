"""``view`` and ``serve``: recordings in the Rerun viewer, of one log or of many."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from rose2_logs.cli.printing import print_line

VIEW_EXAMPLE = (
    "Example: [bold]rose2-logs view results/run[/bold]; on a machine without a screen, "
    "[bold]rose2-logs view results/run --web[/bold]"
)
CATALOG_PORT = 51234
"""Where Rerun's catalog servers listen unless told otherwise."""
SERVE_EXAMPLE = (
    "Example: [bold]rose2-logs serve results[/bold], then [bold]rose2-logs view "
    f"rerun+http://127.0.0.1:{CATALOG_PORT}[/bold]"
)
EXAMPLES = {"view": VIEW_EXAMPLE, "serve": SERVE_EXAMPLE}


def view(
    recording: Annotated[
        str,
        typer.Argument(
            metavar="FILE.rrd",
            help="Recording that analyze wrote, or its folder, or the address that serve printed.",
        ),
    ],
    web: Annotated[
        bool,
        typer.Option("--web", help="Show it in the browser, on a page that this machine alone can open."),
    ] = False,
    port: Annotated[
        int | None,
        typer.Option(
            min=1, max=65535, help="With --web: port of the page. By default a free one.", show_default=False
        ),
    ] = None,
) -> None:
    """Open a recording in the Rerun viewer."""
    from rose2_logs.outputs.rerun import viewer

    source = viewer.find_recording(recording)
    if not web:
        raise typer.Exit(viewer.show(source))
    with viewer.served_page(source, port) as (url, server), suppress(KeyboardInterrupt):
        print_line(f"{url} shows it until Ctrl-C is pressed")
        if viewer.has_screen():
            typer.launch(url)
        server.wait()


def serve(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Results of batch or analyze, searched at any depth.")
    ],
    host: Annotated[
        str,
        typer.Option(help="Address to listen on. 0.0.0.0 lets other machines in, without a password."),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port to listen on; 0 for any that is free.")
    ] = CATALOG_PORT,
) -> None:
    """Serve the recordings of all logs as one Rerun catalog, until Ctrl-C is pressed."""
    import threading

    from rose2_logs.outputs.rerun.catalog import serve_recordings

    with serve_recordings(folder, host, port) as (url, count):
        try:
            print_line(f"{count} recordings at [bold]{url}[/]; open them with [bold]rose2-logs view {url}[/]")
            print_line("Ctrl-C ends the server")
            threading.Event().wait()
        except KeyboardInterrupt:
            raise typer.Exit(0) from None

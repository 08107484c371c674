"""The recordings of many logs opened together: as one data set of a Rerun catalog, by Rerun's own server."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import numpy as np

from rose2_logs.errors import LogError, OutputError, ResultsError
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.outputs.rerun.blueprint import make_blueprint
from rose2_logs.runs.stored_run import StoredRun
from rose2_logs.runs.summary import SUMMARY
from rose2_logs.system.files import reason_of
from rose2_logs.system.guarded_port import guarded_port, hidden_address

if TYPE_CHECKING:
    from rerun.server import Server

logger = logging.getLogger(__name__)

MARGIN_M = 5.0
"""Around the points where rooms are deepest: half a large room."""
NO_TABLES_M = 20.0
"""Half the side of the view, used where no tables say where the rooms are."""


@contextmanager
def serve_recordings(folder: Path, host: str, port: int) -> Iterator[tuple[str, int]]:
    """Serve all recordings below a folder as one data set, named like it.

    Parameters
    ----------
    folder : path
        Searched at any depth. Of recordings of one and the same run the newest is taken.
    host : str
        Address or name to listen on; a page may name it so, or by the names of this machine alone.
    port : int
        Port to listen on; 0 for any that is free.

    Yields
    ------
    url : str
        Address of the catalog.
    count : int
        Number of recordings.

    Raises
    ------
    LogError
        If there is no recording.
    OutputError
        If the server cannot be started.
    """
    from rerun.server import Server

    recordings = find_recordings(folder)
    name = folder.resolve().name or "recordings"
    # Rerun's server answers pages of any site; what stands before it only those of its own names.
    hidden = hidden_address()
    with ExitStack() as stack:
        try:
            server = stack.enter_context(
                Server(host=hidden, port=0, datasets={name: [str(path) for path in recordings]})
            )
            behind = hidden, urlsplit(server.url().removeprefix("rerun+")).port or 0
            port = stack.enter_context(guarded_port(host, port, behind))
        except (OSError, ValueError, OverflowError) as error:
            raise OutputError(f"{host}:{port}: no server can be started there: {reason_of(error)}") from error
        scratch = stack.enter_context(tempfile.TemporaryDirectory(prefix="rose2_logs_"))
        _set_layout(server, name, recordings, Path(scratch))
        shown = f"[{host}]" if ":" in host else host
        yield f"rerun+http://{shown}:{port}", len(recordings)


def find_recordings(folder: Path) -> list[Path]:
    """Find the recordings below a folder, one of each run, sorted.

    Raises
    ------
    LogError
        If there is none.
    """
    from rerun.chunk import RrdReader

    found: dict[str, Path] = {}
    files = [path for path in folder.rglob("*.rrd") if not _is_hidden(path.relative_to(folder))]
    for path in sorted(files, key=lambda path: (-path.stat().st_mtime_ns, path)):
        try:
            ids = [entry.recording_id for entry in RrdReader(path).recordings()]
        except Exception as error:  # Rerun raises what its decoder meets
            logger.warning("%s: is left out: %s", path, error)
            continue
        if taken := [found[each] for each in ids if each in found]:
            logger.warning("%s: is left out: it is of the same run as %s", path, taken[0])
            continue
        found |= dict.fromkeys(ids, path)
    if not found:
        raise LogError(f"{folder}: holds no recording (.rrd); an analysis writes one for each log")
    return sorted(set(found.values()))


def _is_hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts)


def _set_layout(server: Server, name: str, recordings: Sequence[Path], scratch: Path) -> None:
    """Open every run in our layout: the one in each file counts only where it is opened alone."""
    layout = scratch / "layout.rbl"
    back_projected = any(path.with_name("back_projected.parquet").is_file() for path in recordings)
    blueprint = make_blueprint(*_corners_m(recordings), back_projected=back_projected, in_parts=True)
    blueprint.save("rose2_logs", str(layout))
    try:
        server.client().get_dataset(name).register_blueprint(layout.as_uri())
    except ImportError:
        logger.warning(
            "the layout of views is Rerun's; for that of rose2-logs: pip install 'rose2-logs[batch]'"
        )


def _corners_m(recordings: Sequence[Path]) -> tuple[FloatArray, FloatArray]:
    """Corners (2,), in world meters, of the part of the world where the runs have their rooms."""
    points = []
    for path in recordings:
        # A recording needs no results next to it; results that are damaged do not keep it from being shown.
        if (path.parent / SUMMARY).is_file():
            try:
                columns = StoredRun(path.parent).table("rooms", ["label_x_m", "label_y_m"]).drop_null()
            except (ResultsError, OutputError) as error:
                logger.warning("%s; its recording is served all the same", error)
                continue
            points.append(np.column_stack([column.to_numpy() for column in columns.columns]))
    known = np.concatenate([each for each in points if len(each)] or [np.empty((0, 2))])
    if not len(known):
        return np.full(2, -NO_TABLES_M), np.full(2, NO_TABLES_M)
    return known.min(axis=0) - MARGIN_M, known.max(axis=0) + MARGIN_M

"""Fingerprints of results: of maps with true rooms by every method, and of whole runs over logs.

Before a change that must leave the results as they are, and after it:

    python tools/fingerprints.py before.json --cases CASES.json LOG...
    python tools/fingerprints.py after.json --cases CASES.json LOG... --against before.json
"""

from __future__ import annotations

import argparse
import hashlib
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.baselines import METHODS
from rose2_logs.config.parameters import Parameters
from rose2_logs.config.run_options import RunOptions
from rose2_logs.evaluation.cases import Case, load_cases
from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.runs.stored_run import StoredRun
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.workflows.analyze import analyze_log

Fingerprints = dict[str, dict[str, str]]


def fingerprint(*parts: NDArray[Any] | bytes | object) -> str:
    """First digits of the SHA-256 of arrays (values, type and shape), bytes and other values."""
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype} {part.shape}".encode())
            digest.update(np.ascontiguousarray(part).tobytes())
        else:
            digest.update(part if isinstance(part, bytes) else repr(part).encode())
    return digest.hexdigest()[:20]


def of_analysis(found: SnapshotAnalysis) -> dict[str, str]:
    """Fingerprints of what an analysis found."""
    rooms, walls, plan = found.rooms, found.walls, found.floor_plan
    prints = {
        "labels": fingerprint(np.asarray(rooms.labels)),
        "shapes": fingerprint(*(shape.wkb for shape in rooms.polygons)),
        "doorways": fingerprint(*((door.rooms, door.ends_m.tobytes()) for door in rooms.doorways)),
    }
    if walls is not None and plan is not None:
        prints |= {
            "segments": fingerprint(walls.segments_m, walls.segment_cluster),
            "lines": fingerprint(walls.lines_m, walls.line_direction, walls.line_weight),
            "faces": fingerprint(plan.edges_m, plan.edge_weight, plan.room_of_face),
        }
    return prints


def of_cases(cases: tuple[Case, ...]) -> Iterator[tuple[str, dict[str, str]]]:
    """Fingerprints of all cases by all methods."""
    for case in cases:
        for method in METHODS:
            name = f"{case.group}/{case.name}, {method}"
            yield name, of_analysis(analyze(case.snapshot(), Parameters(), method))


def of_log(log: Path) -> dict[str, str]:
    """Fingerprint of each column of the tables of a run over a log."""
    with tempfile.TemporaryDirectory() as folder:
        options = RunOptions(recording=False, annotated_log=False, back_project=True)
        run = StoredRun(analyze_log(log, Path(folder) / "run", options).folder)
        tables = sorted(file.stem for file in run.folder.glob("*.parquet"))
        return {
            f"{name}.{column}": fingerprint(values.to_pylist())
            for name in tables
            for column, values in zip(run.table(name).column_names, run.table(name).columns, strict=True)
        }


def differences(before: Fingerprints, after: Fingerprints) -> list[str]:
    """List what is not the same, or not there any more."""
    return [
        f"{name}: {part} {'differs' if part in after.get(name, {}) else 'is missing'}"
        for name, parts in before.items()
        for part, value in parts.items()
        if after.get(name, {}).get(part) != value
    ]


def main() -> None:
    """Write the fingerprints, and tell what differs from earlier ones."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("logs", type=Path, nargs="*", metavar="LOG")
    parser.add_argument("--cases", type=Path, help="maps with true rooms, as evaluate takes them")
    parser.add_argument("--against", type=Path, help="fingerprints to compare with")
    asked = parser.parse_args()
    prints: Fingerprints = dict(of_cases(load_cases(asked.cases))) if asked.cases else {}
    prints |= {str(log.name): of_log(log) for log in asked.logs}
    asked.out.write_text(json.dumps(prints, indent=1), encoding="utf-8")
    if asked.against is not None:
        found = differences(json.loads(asked.against.read_text(encoding="utf-8")), prints)
        print("\n".join(found) or f"all {len(prints)} are the same")
        raise SystemExit(bool(found))


if __name__ == "__main__":
    main()

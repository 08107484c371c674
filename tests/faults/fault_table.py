"""What comes of every fault in every kind of log, as the table in docs/faults.md.

PYTHONPATH=tests/support:tests/faults python tests/faults/fault_table.py  # writes it anew
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

from bombs import BOMBS
from faulty_logs import (
    FILE_FAULTS,
    FOXGLOVE,
    GRID,
    INPUTS,
    MESSAGE_FAULTS,
    NOT_IN_FOXGLOVE,
    PATH_FAULTS,
    SCHEMA_FAULTS,
    Input,
)
from faulty_maps import SAVED_FAULTS, write_maps

from rose2_logs.config.reading import ReadingParameters
from rose2_logs.errors import LogError
from rose2_logs.io import open_log
from rose2_logs.system.warnings import collect_warnings

PAGE = Path(__file__).parents[2] / "docs" / "faults.md"
LIMITS = ReadingParameters(map_max_cells=1 << 24, chunk_max_bytes=4 << 20)
"""Lower than the defaults, so that the bombs of the tests can be small."""
BEGIN, END = "<!-- table {} -->", "<!-- end -->"
SAVED = ("map_server, png", "map_server, pgm")

Case = tuple[str, str]
"""A fault and a kind of log."""


def message_cases() -> list[Case]:
    """Faults of messages and of their definitions."""
    cases = [
        (fault, name)
        for fault in MESSAGE_FAULTS
        for name in (*INPUTS, FOXGLOVE.name)
        if name != FOXGLOVE.name or fault not in NOT_IN_FOXGLOVE
    ]
    return cases + [(fault, name) for fault in SCHEMA_FAULTS for name in INPUTS]


def file_cases() -> list[Case]:
    """Faults of files."""
    cases = [(fault, name) for fault in FILE_FAULTS for name in INPUTS]
    return cases + [(fault, name) for fault, (_, names) in PATH_FAULTS.items() for name in names]


def saved_cases() -> list[Case]:
    """Faults of saved maps."""
    return [(fault, name) for fault in SAVED_FAULTS for name in SAVED]


def bomb_cases() -> list[Case]:
    """What is far larger than it looks."""
    return [(fault, "") for fault in BOMBS]


TABLES = {
    "messages": message_cases,
    "files": file_cases,
    "saved maps": saved_cases,
    "bombs": bomb_cases,
}


def make(table: str, case: Case, folder: Path) -> Path:
    """Write the log of a case."""
    fault, name = case
    if table == "bombs":
        return BOMBS[fault](folder)
    if table == "saved maps":
        ending = name.rpartition(" ")[2]
        log = write_maps(folder / "run", ending)
        SAVED_FAULTS[fault](log / "map1.yaml", log / f"map1.{ending}")
        return log
    kind: Input = INPUTS.get(name, FOXGLOVE)
    if fault in SCHEMA_FAULTS:
        return kind.make(folder, schemas={GRID: SCHEMA_FAULTS[fault]})
    if table == "messages":
        return kind.make(folder, MESSAGE_FAULTS[fault]())
    log = kind.make(folder)
    if fault in PATH_FAULTS:
        return PATH_FAULTS[fault][0](log)
    FILE_FAULTS[fault](kind.data_file(log))
    return log


def outcome(log: Path) -> str:
    """Read a log and tell what came of it in a few words; anything but a known error is raised."""
    with collect_warnings() as warning_log:
        try:
            with open_log(log, limits=LIMITS) as reader:
                maps = sum(1 for _ in reader.snapshots())
                counts = reader.counts
        except LogError as error:
            return f"error: {_plain(error, log)}"
    kinds = [f"{found.count} × {kind}" for kind, found in warning_log.kinds.items()]
    repeats = f", {counts.repeats} repeats" if counts.repeats else ""
    return f"{maps} of {counts.messages} map messages{repeats}" + "".join(f", {kind}" for kind in kinds)


def _plain(error: LogError, log: Path) -> str:
    text = str(error)
    if "\n" in text or str(log) not in text:
        raise AssertionError(f"no line that names the log: {text!r}") from error
    text = text.replace(str(log), "LOG").replace("|", "/")
    # What libraries say differs with their versions.
    text = re.sub(r"(image of a map: ).*?(?=;|$)", r"\1…", text)
    text = re.sub(r"(is not YAML: ).*?(?=;|$)", r"\1…", text)
    return text.replace("<", "&lt;")


def rows(table: str) -> Iterator[tuple[str, str, str]]:
    """Yield the fault, the outcome and the kinds of logs of each row of a table."""
    found: dict[str, dict[str, list[str]]] = {}
    for case in TABLES[table]():
        with tempfile.TemporaryDirectory() as folder:
            told = outcome(make(table, case, Path(folder)))
        found.setdefault(case[0], {}).setdefault(told, []).append(case[1])
    for fault, outcomes in found.items():
        for told, names in outcomes.items():
            yield fault, told, "; ".join(names) if len(outcomes) > 1 else "all"


def as_markdown(table: str) -> str:
    """Make the lines of a table."""
    lines = ["| fault | outcome | in |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows(table))])


def expected(table: str) -> dict[Case, str]:
    """Outcomes by the page."""
    text = PAGE.read_text(encoding="utf-8").partition(BEGIN.format(table))[2].partition(END)[0]
    told: dict[Case, str] = {}
    names: dict[str, list[str]] = {}
    for fault, name in TABLES[table]():
        names.setdefault(fault, []).append(name)
    for line in text.strip().splitlines()[2:]:
        fault, outcome_text, listed = (part.strip() for part in line.strip().strip("|").split(" | "))
        matched = names.get(fault, ["?"]) if listed == "all" else listed.split("; ")
        told |= {(fault, name): outcome_text for name in matched}
    return told


def main() -> None:
    """Write the tables anew into the page."""
    page = PAGE.read_text(encoding="utf-8")
    for table in TABLES:
        before, begin, rest = page.partition(BEGIN.format(table))
        _, end, after = rest.partition(END)
        page = f"{before}{begin}\n{as_markdown(table)}\n{end}{after}"
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()

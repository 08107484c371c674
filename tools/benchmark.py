#!/usr/bin/env python3
"""Measure the project: `accuracy` writes every figure of every method into one report.

Examples
--------
    # all methods over the room segmentation benchmark, with ablations and robustness
    python tools/benchmark.py accuracy -o DIR
    # over simulated buildings, robustness on three maps of each group; --cases takes several files
    python tools/make_sample_logs.py --cases SIMULATED --count 20 --seed 100
    python tools/benchmark.py accuracy --cases SIMULATED/cases.json --sample 3 -o DIR
    # quickly: figures and pictures of one method
    python tools/benchmark.py accuracy --methods rose2 --skip ablations robustness -o DIR

DIR/report.md is the report, DIR/report.json holds all of it as numbers; DIR/pictures shows every map with its
true rooms, the found ones, and what is wrong.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarking.accuracy import AccuracyOptions, measure_accuracy
from benchmarking.references import ABLATIONS_FILE, PUBLISHED_FILE
from benchmarking.report import write_report

from rose2_logs.errors import Rose2LogsError
from rose2_logs.pipeline import METHODS

SHARED_CASES = Path(__file__).parents[2] / "shared" / "benchmark" / "cases.json"
"""The room segmentation benchmark's place beside the project."""
PARTS = ("ablations", "robustness", "pictures")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_accuracy(
        commands.add_parser(
            "accuracy",
            help="figures against true rooms, ablations, robustness",
            description=__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
    )
    options = parser.parse_args(arguments)
    try:
        code: int = options.run(options)
    except Rose2LogsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return code


def _add_accuracy(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("-o", "--output", type=Path, required=True, metavar="DIR", help="folder of the report")
    add(
        "--cases",
        type=Path,
        nargs="+",
        default=[SHARED_CASES],
        metavar="CASES.json",
        help="maps with true rooms; by default the benchmark beside the project, others from "
        "tools/make_sample_logs.py --cases",
    )
    add("--methods", nargs="+", choices=METHODS, default=METHODS, help="by default: %(default)s")
    add("--skip", nargs="+", choices=PARTS, default=[], help="parts to leave out")
    add("--sample", type=int, metavar="N", help="robustness on N maps of each group; by default on all")
    add(
        "--runs",
        default="incremental",
        metavar="PREFIX",
        help="groups whose names begin so are runs, shown over their coverage (%(default)s)",
    )
    add("--ablations", type=Path, metavar="FILE.toml", help=f"by default {ABLATIONS_FILE.name} of the tool")
    add(
        "--published",
        type=Path,
        metavar="FILE.toml",
        help=f"figures by name of the group; by default {PUBLISHED_FILE.name} of the tool",
    )
    add("--config", type=Path, metavar="FILE.toml", help="parameters, one table per stage")
    add("--set", action="append", default=[], metavar="STAGE.NAME=VALUE", help="change one parameter")
    add("--workers", type=int, default=1, help="processes (%(default)s)")
    parser.set_defaults(run=_accuracy)


def _accuracy(options: argparse.Namespace) -> int:
    accuracy = measure_accuracy(
        AccuracyOptions(
            cases=tuple(options.cases),
            folder=options.output,
            methods=tuple(options.methods),
            runs=options.runs,
            ablations=options.ablations,
            published=options.published,
            sample=options.sample,
            skip=frozenset(options.skip),
            config=options.config,
            settings=tuple(options.set),
            workers=options.workers,
        )
    )
    print(write_report(accuracy, options.output))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

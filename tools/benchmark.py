#!/usr/bin/env python3
"""Measure the project and write reports.

`accuracy` gives every figure of every method; `tables` those of the accuracy page, by group and by building;
`sensitivity` how much the figures hang on each parameter, and what a choice made without a building gives
there; `speed` how fast everything is.

Examples
--------
    # all methods over the room segmentation benchmark, with ablations and robustness
    python tools/benchmark.py accuracy -o DIR
    # over simulated buildings, robustness on three maps of each group; --cases takes several files
    python tools/make_sample_logs.py --cases SIMULATED --count 20 --seed 100
    python tools/benchmark.py accuracy --cases SIMULATED/cases.json --sample 3 -o DIR
    # quickly: figures and pictures of one method
    python tools/benchmark.py accuracy --methods rose2 --skip ablations robustness -o DIR
    # the tables of the accuracy page, with rooms of changed maps on two maps of each group
    python tools/benchmark.py tables --sample 2 -o DIR
    # each parameter of the stages a step down and up, or only some of them
    python tools/benchmark.py sensitivity -o DIR
    python tools/benchmark.py sensitivity --parameters "walls.*" floor_plan.join_min_openness -o DIR
    # how fast everything is, on an otherwise idle machine; at a glance with --quick
    python tools/benchmark.py speed -o DIR

DIR/report.md is the report, DIR/report.json holds all of it as numbers; DIR/pictures shows every map with its
true rooms, the found ones, and what is wrong. That of speed is DIR/speed.md with speed.png and speed.json;
`tables` writes DIR/tables.md and DIR/tables.json.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarking.accuracy import AccuracyOptions, load_all_cases, measure_accuracy
from benchmarking.page import METHODS_FILE, load_methods, measure_page, write_page
from benchmarking.references import ABLATIONS_FILE, PUBLISHED_FILE
from benchmarking.report import write_report
from benchmarking.sensitivity import (
    BUILDINGS_FILE,
    buildings_of,
    make_variants,
    measure_sensitivity,
    sensitivity_as_json,
    sensitivity_report,
)
from benchmarking.speed import FULL, QUICK, SpeedOptions, measure_speed
from benchmarking.speed_report import write_speed_report

from rose2_logs.config.parameters import load_parameters
from rose2_logs.errors import Rose2LogsError
from rose2_logs.runs.summary import write_json
from rose2_logs.segmentation.pipeline import METHODS

SHARED_CASES = Path(__file__).parents[2] / "shared" / "benchmark" / "cases.json"
"""The room segmentation benchmark's place beside the project."""
SAMPLE_LOGS = [
    Path(__file__).parents[1] / "sample_logs" / name for name in ("office.mcap", "wing.bag", "ring")
]
PARTS = ("ablations", "robustness", "pictures")
SPEED_PARTS = ("maps", "tiles", "logs", "outputs")


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
    _add_tables(
        commands.add_parser(
            "tables",
            help="the tables of the accuracy page",
            description="Compare methods by group and by building, with ranges over buildings, and the rooms "
            "of each method on maps that are turned, mirrored, padded, finer, or lack 1 % of their cells.",
        )
    )
    _add_sensitivity(
        commands.add_parser(
            "sensitivity",
            help="figures with each parameter changed, and with buildings left out",
            description=__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
    )
    _add_speed(
        commands.add_parser(
            "speed",
            help="times, memory and how both grow: maps, logs, workers, outputs, starting up",
            description="Time maps on one core by stage, beside a floor and the other methods; a building "
            "tiled again and again; logs of 10 to 1000 maps with one and two workers; outputs, copying, "
            "starting up.",
        )
    )
    options = parser.parse_args(arguments)
    try:
        code: int = options.run(options)
    except Rose2LogsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return code


def _add_common(parser: argparse.ArgumentParser) -> None:
    _add_output_and_cases(parser)
    add = parser.add_argument
    add("--config", type=Path, metavar="FILE.toml", help="parameters, one table per stage")
    add("--set", action="append", default=[], metavar="STAGE.NAME=VALUE", help="change one parameter")
    add("--workers", type=int, default=1, help="processes (%(default)s)")


def _add_output_and_cases(parser: argparse.ArgumentParser) -> None:
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


def _add_accuracy(parser: argparse.ArgumentParser) -> None:
    _add_common(parser)
    add = parser.add_argument
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
    parser.set_defaults(run=_accuracy)


def _add_tables(parser: argparse.ArgumentParser) -> None:
    _add_output_and_cases(parser)
    add = parser.add_argument
    add(
        "--methods",
        type=Path,
        default=METHODS_FILE,
        metavar="FILE.toml",
        help=f"what is compared; by default {METHODS_FILE.name} of the tool",
    )
    add("--sample", type=int, default=2, metavar="N", help="change N maps of each group (%(default)s)")
    add("--config", type=Path, metavar="FILE.toml", help="parameters that all methods start from")
    add("--workers", type=int, default=1, help="processes (%(default)s)")
    parser.set_defaults(run=_tables)


def _add_sensitivity(parser: argparse.ArgumentParser) -> None:
    _add_common(parser)
    add = parser.add_argument
    add("--parameters", nargs="+", default=[], metavar="PATTERN", help='as "walls.*"; by default all')
    add(
        "--buildings",
        type=Path,
        default=BUILDINGS_FILE,
        metavar="FILE.toml",
        help=f"which maps show one building; by default {BUILDINGS_FILE.name} of the tool",
    )
    parser.set_defaults(run=_sensitivity)


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


def _tables(options: argparse.Namespace) -> int:
    methods = load_methods(options.methods, options.config)
    page = measure_page(options.cases, methods, options.sample, options.workers)
    print(write_page(page, options.output))
    return 0


def _sensitivity(options: argparse.Namespace) -> int:
    cases = load_all_cases(options.cases)
    parameters = load_parameters(options.config, options.set)
    variants = make_variants(parameters, options.parameters)
    buildings = buildings_of(cases, options.buildings)
    measured = measure_sensitivity(cases, METHODS[0], variants, buildings, options.workers, sys.stderr.write)
    write_json(options.output / "report.json", sensitivity_as_json(measured))
    report = options.output / "report.md"
    report.write_text(sensitivity_report(measured), encoding="utf-8")
    print(report)
    return 0


def _add_speed(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("-o", "--output", type=Path, required=True, metavar="DIR", help="folder of the report")
    add(
        "--cases",
        type=Path,
        nargs="*",
        default=[SHARED_CASES],
        metavar="CASES.json",
        help="maps to time; by default the benchmark beside the project; none of them where this is empty",
    )
    add(
        "--logs",
        type=Path,
        nargs="+",
        default=SAMPLE_LOGS,
        metavar="LOG",
        help="logs to time; the first, an MCAP, also gives the building of the scaling runs; by default the "
        "samples",
    )
    add("--quick", action="store_true", help="a glance: few maps, short logs, everything once")
    add("--skip", nargs="+", choices=SPEED_PARTS, default=[], help="parts to leave out")
    add("--config", type=Path, metavar="FILE.toml", help="parameters, one table per stage")
    add("--set", action="append", default=[], metavar="STAGE.NAME=VALUE", help="change one parameter")
    add(
        "--against",
        type=Path,
        metavar="PATH",
        help="checkout of another version, timed by turns on the same maps and logs (git worktree add "
        "PATH COMMIT)",
    )
    parser.set_defaults(run=_speed)


def _speed(options: argparse.Namespace) -> int:
    speed = measure_speed(
        SpeedOptions(
            cases=tuple(options.cases),
            logs=tuple(options.logs),
            amount=QUICK if options.quick else FULL,
            skip=frozenset(options.skip),
            config=options.config,
            settings=tuple(options.set),
            against=options.against and options.against.resolve(),
        )
    )
    print(write_speed_report(speed, options.output))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

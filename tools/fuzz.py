"""Fuzz the readers and the update patches, guided by coverage.

Needs atheris, which has wheels for Linux: ``pip install atheris``. Each target runs in a process of its own,
from seeds that are made of the sample logs; what it finds is kept in the folder and taken up the next time.

    python tools/fuzz.py run --seconds 300 --folder fuzzing      # all targets, one after the other
    python tools/fuzz.py run --seconds 60 --folder fuzzing mcap  # one of them
    python tools/fuzz.py again FILE TARGET                       # one input that was found

A target ends before its time when it finds a fault: an exception that is not a known error, more memory than
`MEMORY_MB`, or more than `INPUT_SECONDS` for one input. Figures of a long run are in docs/faults.md.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import subprocess
import sys
from pathlib import Path

PROJECT = Path(__file__).parents[1]
SAMPLES = [PROJECT / "sample_logs" / name for name in ("office.mcap", "wing.bag")]
MEMORY_MB = 1024
"""Of a process; the libraries alone take some 300 MB, the inputs' limits are far lower."""
INPUT_SECONDS = 10
"""An input of some kilobytes takes milliseconds."""
INPUT_BYTES = 32_768
"""Largest input that is tried."""


def run(targets: list[str], seconds: int, folder: Path, seed: int) -> int:
    """Run the targets one after the other; returns the number of those that found a fault."""
    from fuzzing.corpus import make_corpus

    make_corpus(SAMPLES, folder / "seeds")
    faults = 0
    for target in targets:
        found, kept = folder / "corpus" / target, folder / "found"
        found.mkdir(parents=True, exist_ok=True)
        kept.mkdir(exist_ok=True)
        command = [sys.executable, __file__, "target", target, str(found), str(folder / "seeds" / target)]
        command += [
            f"-max_total_time={seconds}",
            f"-rss_limit_mb={MEMORY_MB}",
            f"-timeout={INPUT_SECONDS}",
            f"-max_len={INPUT_BYTES}",
            f"-artifact_prefix={kept}/{target}_",
            f"-seed={seed}",
            "-print_final_stats=1",
        ]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(command, capture_output=True, text=True, check=False, errors="replace")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        told = done.stdout + done.stderr
        (folder / f"{target}.log").write_text(told, encoding="utf-8")
        executions = re.search(r"number_of_executed_units:\s*(\d+)", told)
        coverage = re.findall(r"cov: (\d+)", told)
        figures = {
            "target": target,
            "executions": int(executions.group(1)) if executions else 0,
            "cpu_s": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime),
            "coverage_edges": int(coverage[-1]) if coverage else 0,
            "fault": done.returncode != 0,
        }
        with (folder / "figures.jsonl").open("a", encoding="utf-8") as log:
            log.write(json.dumps(figures) + "\n")
        print(json.dumps(figures), flush=True)
        faults += done.returncode != 0
    return faults


def fuzz(target: str, arguments: list[str]) -> None:
    """Be the process that runs one target; it ends within."""
    import atheris

    with atheris.instrument_imports(include=["rose2_logs.io", "rose2_logs.outputs.mcap.input"]):
        from fuzzing import targets

    targets.quieten()
    atheris.Setup([sys.argv[0], *arguments], targets.TARGETS[target])
    atheris.Fuzz()


def again(file: Path, target: str) -> None:
    """Run one input of a target."""
    from fuzzing import targets

    targets.TARGETS[target](file.read_bytes())


def main() -> None:
    """Read the arguments and run."""
    from fuzzing.targets import TARGETS

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    runs = commands.add_parser("run", help="fuzz")
    runs.add_argument("targets", nargs="*", metavar="TARGET", help=f"of {', '.join(TARGETS)}; by default all")
    runs.add_argument("--seconds", type=int, default=300, help="for each target")
    runs.add_argument("--folder", type=Path, required=True, help="for seeds, corpus, what is found, figures")
    runs.add_argument("--seed", type=int, default=1, help="of the random numbers")
    repeat = commands.add_parser("again", help="run one input")
    repeat.add_argument("file", type=Path)
    repeat.add_argument("target", choices=TARGETS)
    asked = parser.parse_args()
    if asked.command == "again":
        again(asked.file, asked.target)
        return
    if unknown := set(asked.targets) - set(TARGETS):
        parser.error(f"no target {min(unknown)}; there are: {', '.join(TARGETS)}")
    sys.exit(1 if run(asked.targets or list(TARGETS), asked.seconds, asked.folder, asked.seed) else 0)


if __name__ == "__main__":
    if sys.argv[1:2] == ["target"]:
        fuzz(sys.argv[2], sys.argv[3:])
    else:
        main()

"""Times the analysis of benchmark maps in the version of the project that is imported; for `against`.

It must run in any version: what they call the same thing is tried name by name. It is given files of cases
and, behind ``--set``, parameters; asked for maps by number, a line each, it answers with seconds of processor
time.
"""

import importlib
import json
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any


def found(*names: str) -> Any:
    """Return the first of some things that this version has, each named as in ``module:thing``."""
    for name in names:
        module, _, thing = name.partition(":")
        try:
            return getattr(importlib.import_module(module), thing)
        except (ImportError, AttributeError):
            continue
    raise SystemExit(f"this version has none of {', '.join(names)}")


def main() -> None:
    """Answer until the input ends."""
    import cv2
    import numpy as np

    analyze = found("rose2_logs.segmentation.pipeline:analyze", "rose2_logs.pipeline:analyse")
    load_parameters = found(
        "rose2_logs.config.parameters:load_parameters", "rose2_logs.parameters:load_parameters"
    )
    load_cases = found("rose2_logs.evaluation.cases:load_cases")
    with suppress(SystemExit):  # a version whose commands do this measures with it
        found("rose2_logs.system.workers:keep_freed_memory")()
    cv2.setNumThreads(1)
    at = sys.argv.index("--set")
    cases = [case for path in sys.argv[1:at] for case in load_cases(Path(path))]
    parameters = load_parameters(None, tuple(sys.argv[at + 1 :]))
    for line in sys.stdin:
        number, repeats = json.loads(line)
        snapshot = cases[number].snapshot()
        rooms = len(analyze(snapshot, parameters).rooms)
        seconds = []
        for _ in range(repeats):
            start = time.process_time()
            analyze(cases[number].snapshot(), parameters)
            seconds.append(time.process_time() - start)
        print(json.dumps([float(np.median(seconds)), rooms]), flush=True)


main()

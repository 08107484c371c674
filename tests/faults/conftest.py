"""The makers of logs beside the readers' tests, and what the fuzzing tool runs, serve here too."""

import sys
from pathlib import Path

TESTS = Path(__file__).parents[1]
sys.path[:0] = [str(TESTS / "readers"), str(TESTS.parent / "tools")]

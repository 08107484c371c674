"""What may import what, where libraries of formats and surfaces live, and that files stay readable.

The order of the folders stands in ``pyproject.toml`` as contracts of import-linter.
"""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from importlinter.application.use_cases import lint_imports
from importlinter.configuration import configure

PROJECT = Path(__file__).parents[1]
PACKAGE = PROJECT / "rose2_logs"
FILES = sorted(PACKAGE.rglob("*.py"))
MOST_LINES = 600
LONGEST_FUNCTION = 70
"""Lines of code, without docstring and signature."""


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def name(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def test_imports_keep_the_contracts(monkeypatch, capsys):
    """Folders import only those below them, outputs do not know each other, nothing goes in circles."""
    monkeypatch.chdir(PROJECT)
    # The command itself would silence all loggers of this process.
    configure()
    kept = lint_imports(config_filename="pyproject.toml", cache_dir=None)
    assert kept, capsys.readouterr().out


def test_only_the_command_line_prints():
    """No print and no sys.exit elsewhere."""
    found = [
        f"{name(path)}:{node.lineno}"
        for path in FILES
        if name(path).split("/")[0] not in ("cli", "__main__.py")
        for node in ast.walk(tree(path))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("print", "sys.exit", "exit")
    ]
    assert not found


def test_files_stay_readable():
    """No file grows past what can be read in one go, and each says in its first line what it is."""
    assert not [name(path) for path in FILES if path.read_text(encoding="utf-8").count("\n") > MOST_LINES]
    assert not [name(path) for path in FILES if not ast.get_docstring(tree(path))]


def test_functions_stay_readable():
    """No function is longer than a screen or so."""
    long = []
    for path in FILES:
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                body = node.body[1:] if ast.get_docstring(node) else node.body
                if body and (body[-1].end_lineno or 0) - body[0].lineno + 1 > LONGEST_FUNCTION:
                    long.append(f"{name(path)}:{node.name}")
    assert not long


def test_tests_mirror_the_package():
    """A folder of tests for each folder of the package, and none for what is no longer there."""
    of_package = {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"}
    of_tests = {path.name for path in (PROJECT / "tests").iterdir() if path.is_dir()}
    assert of_tests - {"__pycache__", "faults", "look", "support", "tools"} <= of_package
    assert of_package - of_tests <= {"config"}

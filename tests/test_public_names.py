"""What ``import rose2_logs`` offers: all of it is there, told to type checkers, and imported when used."""

from __future__ import annotations

import ast
import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import rose2_logs

HEAVY = ("numpy", "pyarrow", "cv2", "shapely", "scipy", "rerun", "mcap", "rosbags", "pandas", "matplotlib")


def stub() -> ast.Module:
    return ast.parse(Path(rose2_logs.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))


def test_every_name_is_there():
    for name in rose2_logs.__all__:
        assert getattr(rose2_logs, name) is not None, name
    assert set(rose2_logs.__all__) <= set(dir(rose2_logs))
    assert len(set(rose2_logs.__all__)) == len(rose2_logs.__all__)


def test_the_stub_names_the_same_from_the_same_modules():
    """Type checkers see only the stub."""
    told = {}
    for node in stub().body:
        if isinstance(node, ast.ImportFrom):
            told |= {alias.asname: (node.module, alias.name) for alias in node.names}
    homes = rose2_logs._HOMES
    expected = {name: (f"rose2_logs.{home}", name) for home, names in homes.items() for name in names}
    assert told == expected
    assert {*told, "__version__"} == set(rose2_logs.__all__)


def test_names_are_where_they_are_said_to_be():
    """Defined there, not only imported there."""
    for home, names in rose2_logs._HOMES.items():
        module = importlib.import_module(f"rose2_logs.{home}")
        for name in names:
            assert getattr(module, name).__module__ == module.__name__, name


def test_another_name_is_told_as_python_does():
    with pytest.raises(AttributeError, match="module 'rose2_logs' has no attribute 'analyse'"):
        rose2_logs.analyse  # noqa: B018


def test_importing_the_package_imports_no_library():
    """Each is imported when the first name that needs it is used."""
    program = (
        "import sys, rose2_logs\n"
        f"print(sorted(set(sys.modules) & {set(HEAVY)!r}), rose2_logs.__version__)\n"
        "dir(rose2_logs)\n"
        f"print(sorted(set(sys.modules) & {set(HEAVY)!r}))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == f"[] {rose2_logs.__version__}\n[]\n"


def test_everything_public_says_what_it_is():
    """Also each public method and property of the classes."""
    without = []
    for name in rose2_logs.__all__:
        what = getattr(rose2_logs, name)
        if inspect.isclass(what) or inspect.isfunction(what):
            if not inspect.getdoc(what):
                without.append(name)
            for member, value in vars(what).items() if inspect.isclass(what) else ():
                is_told = inspect.isfunction(value) or isinstance(value, property | classmethod)
                if is_told and not member.startswith("_") and not inspect.getdoc(getattr(what, member)):
                    without.append(f"{name}.{member}")
    assert not without


def test_functions_take_parameters_by_name():
    """A mapping of dotted names wherever there are parameters."""
    for name in ("analyze", "track", "segment", "open_log", "evaluate"):
        function = getattr(rose2_logs, name)
        assert inspect.signature(function).parameters["parameters"].kind is inspect.Parameter.KEYWORD_ONLY

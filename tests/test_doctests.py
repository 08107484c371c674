"""The examples in docstrings run as they stand there, and everything public has one."""

from __future__ import annotations

import doctest
import importlib
import inspect
from pathlib import Path

import pytest

import rose2_logs

PROJECT = Path(__file__).parents[1]
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def examples() -> list[doctest.DocTest]:
    """Those of all modules of the package."""
    files = sorted((PROJECT / "rose2_logs").rglob("*.py"))
    names = [
        ".".join(file.relative_to(PROJECT).with_suffix("").parts)
        for file in files
        if ">>> " in file.read_text(encoding="utf-8")
    ]
    found = (doctest.DocTestFinder().find(importlib.import_module(name)) for name in names)
    return [test for of_module in found for test in of_module if test.examples]


@pytest.mark.parametrize("test", examples(), ids=lambda test: test.name)
def test_examples_print_what_they_say(test: doctest.DocTest, monkeypatch):
    """From the project's folder, where its sample logs are."""
    monkeypatch.chdir(PROJECT)
    said: list[str] = []
    doctest.DocTestRunner(optionflags=OPTIONS).run(test, out=said.append)
    assert not said, "".join(said)


def test_everything_public_has_an_example():
    """But errors, which are raised by others."""
    public = {name: getattr(rose2_logs, name) for name in rose2_logs.__all__ if name != "__version__"}
    without = [
        name
        for name, what in public.items()
        if not (inspect.isclass(what) and issubclass(what, Exception))
        and not ("Examples\n" in (inspect.getdoc(what) or "") and ">>> " in (what.__doc__ or ""))
    ]
    assert not without

"""The command line as the tests call it."""

from __future__ import annotations

import sys

import pytest

from rose2_logs.cli.main import main
from rose2_logs.cli.messages import style


@pytest.fixture
def cli(monkeypatch, capfd):
    """Run the command line; returns exit code, stdout and stderr."""

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["rose2-logs", *map(str, arguments)])
        monkeypatch.setattr(style, "debug", False)
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capfd.readouterr()
        return int(ended.value.code or 0), out, err

    return run

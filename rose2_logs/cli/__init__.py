"""The command line ``rose2-logs``: the only place that prints."""

from __future__ import annotations

import os
import sys


def _open_closed_streams() -> None:
    """Lead standard streams that are closed nowhere, so that no file that is opened takes their place."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDWR)
            if nowhere != number:
                os.dup2(nowhere, number)
                os.close(nowhere)
            # Worker processes have the same streams.
            os.set_inheritable(number, True)
            setattr(sys, name, open(number, "w" if number else "r", encoding="utf-8", closefd=False))  # noqa: SIM115


_open_closed_streams()

"""Packages that only some people need, and that come with an extra."""

from __future__ import annotations

from importlib.util import find_spec

from rose2_logs.errors import MissingPackageError


def need(package: str, purpose: str, extra: str) -> None:
    """Refuse what cannot be done without a package, before anything is done.

    Parameters
    ----------
    package : str
        Its name, as it is imported.
    purpose : str
        Who needs it, a plural that begins the message.
    extra : str
        The extra of `rose2-logs` that brings it along.

    Raises
    ------
    MissingPackageError
        If it is not installed.
    """
    if find_spec(package) is None:
        raise MissingPackageError(
            f"{purpose} need {package}, which is not installed: pip install 'rose2-logs[{extra}]'"
        )

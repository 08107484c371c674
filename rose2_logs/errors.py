"""One tree of exceptions; the message of each names what is wrong, where, and the remedy."""

from __future__ import annotations

from pathlib import Path


class Rose2LogsError(Exception):
    """A known failure: the command line prints its message as one line and exits non-zero.

    Parameters
    ----------
    message : str
        One line, complete in itself.
    file : path, optional
        The file that is concerned.
    topic : str, optional
        The topic.
    index : int, optional
        Number of the message on its topic, or of the snapshot, from 1.
    """

    def __init__(
        self,
        message: str,
        *,
        file: Path | str | None = None,
        topic: str | None = None,
        index: int | None = None,
    ) -> None:
        super().__init__(message)
        self.file = None if file is None else str(file)
        self.topic = topic
        self.index = index


class LogError(Rose2LogsError):
    """A log cannot be opened or read."""


class NoMapTopicError(LogError):
    """A log holds no topic with occupancy grids, or several and none was chosen."""


class InvalidMapError(LogError):
    """A map message or a map file contradicts itself (size, resolution, origin, data)."""


class ParameterError(Rose2LogsError):
    """A parameter, a configuration file or a command line option has a value that cannot be used."""


class CasesError(Rose2LogsError):
    """A file of evaluation cases, or a file that it names, cannot be used."""


class ResultsError(LogError):
    """A folder is not one that a run has written, or is damaged or of another version."""


class MissingPackageError(Rose2LogsError):
    """A function needs a package that is not installed."""


class OutputError(Rose2LogsError):
    """A result cannot be written."""


class AlreadyWholeError(OutputError):
    """Results that were to be completed are whole: nothing is left to do."""

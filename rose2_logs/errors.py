"""One tree of exceptions; the message of each names what is wrong, where, and the remedy."""


class Rose2LogsError(Exception):
    """A known failure: the command line prints its message as one line and exits non-zero."""


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


class OutputError(Rose2LogsError):
    """A result cannot be written."""

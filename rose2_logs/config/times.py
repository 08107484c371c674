"""The range of log times, which are 64 bit integers that count nanoseconds since the epoch."""

LATEST_NS = 2**63 - 1
"""The latest log time, in the year 2262; a later one in a log is damage."""
LONGEST_LOG_S = 2.0**63 / 1e9
"""No log lasts longer, in seconds."""

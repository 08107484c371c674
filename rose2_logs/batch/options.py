"""Options of a batch, in addition to those of the run of each log."""

from __future__ import annotations

from dataclasses import dataclass, field

from rose2_logs.config.run_options import MOST_WORKERS, OUTPUTS, RunOptions, check_options, explained, option
from rose2_logs.errors import ParameterError

MACHINES = "Where and how often"
"""Group of options in the help."""
BATCH = ("batch",)


@explained
@dataclass(frozen=True)
class BatchOptions:
    """What to take from each log, how to analyze it, what to write (`run`), and how to run the batch.

    Options of `run` that only `analyze` has are ignored here.

    Raises
    ------
    ParameterError
        If a value cannot be used; the message names the option.
    """

    run: RunOptions = field(default_factory=RunOptions)
    workers: int | None = option(
        None,
        "Number of logs analyzed at the same time on this machine: by default one for each processor, and at "
        "most two.",
        panel=MACHINES,
        commands=BATCH,
        metavar="N",
        low=1,
        high=MOST_WORKERS,
    )
    scheduler: str | None = option(
        None,
        "Address, or scheduler file, of the scheduler of a Dask cluster that does the work. Its workers must "
        "see OUT, unless it is a URL, and local logs at the same paths as this machine.",
        panel=MACHINES,
        commands=BATCH,
        metavar="ADDRESS",
    )
    retries: int = option(
        2,
        "How often a log is tried again after its worker was lost, or storage or network failed.",
        panel=MACHINES,
        commands=BATCH,
        metavar="N",
        low=0,
    )
    overwrite: bool = option(
        False,
        "Replace results that were made with other options, and results of logs that have changed.",
        panel=OUTPUTS,
        commands=BATCH,
    )
    rerun: bool = option(
        False, "Also analyze logs again whose results are up to date.", panel=OUTPUTS, commands=BATCH
    )

    def __post_init__(self) -> None:
        check_options(self)
        if self.scheduler is not None and self.workers is not None:
            raise ParameterError(
                f"workers={self.workers} is for this machine; a cluster has the workers that joined its "
                "scheduler"
            )

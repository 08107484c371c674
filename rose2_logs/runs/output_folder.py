"""The folder for the results of a run: they appear in it all at once, when the last one is complete.

Until then they are written to a hidden folder next to it, with the journal of the run.
"""

from __future__ import annotations

import json
import logging
import os
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rose2_logs.errors import AlreadyWholeError, OutputError
from rose2_logs.runs.journal import Journal, KeptMaps, kept_maps
from rose2_logs.runs.provenance import log_files
from rose2_logs.system.files import locked, refuse_existing, writing
from rose2_logs.system.text import counted, listed
from rose2_logs.system.warnings import UNCOUNTED
from rose2_logs.system.workers import WorkerError

logger = logging.getLogger(__name__)

TOLD_MOST = 5
"""Files that are told in one line."""
MADE_OF_RESULTS = re.compile(
    r"report(_part_\d+)?\.html|.+\.(figure\.(png|svg)|floor_plan\.(geojson|svg|dxf)|graph\.json"
    r"|rooms\.(pgm|yaml|list\.yaml|labels\.png|geojson)|\w+\.qml)"
)
"""Names of what ``report``, ``figure`` and ``export`` make of the results of a run."""
MAY_PASS = (OutputError, WorkerError, OSError, MemoryError)
"""After these errors, as after Ctrl-C, another try may go on; the others would come again."""


class OutputFolder:
    """Where the results of a run are made and where they come to stand.

    A folder that is not there appears with all results in it, by one renaming. Into one that is there the
    files are moved one after the other, the summary last: as long as it is missing they are not whole. What
    an earlier run has written there besides, as its recording where this one makes none, goes. Pages, figures
    and plans that were made of its results stay, and are told.

    Parameters
    ----------
    folder : path
        For the results.
    names : sequence of str
        Of the files, that of the summary last.

    Attributes
    ----------
    files : tuple of path
        Where they come to stand.
    """

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        self._names = tuple(names)
        self.files = tuple(folder / name for name in names)
        self._folder = folder
        self._place = folder.resolve()
        self._sources: tuple[Path, ...] = ()
        # Files can be renamed within a file system only.
        base = self._place if self._place.is_mount() else self._place.parent
        self._work, self._journal, self._lock = (
            base / f".{self._place.name}.{kind}" for kind in ("part", "journal", "lock")
        )

    def refuse_log(self, log: Path) -> None:
        """Refuse to write over a log, or into its folder, and a place that is no folder.

        Raises
        ------
        OutputError
            If a result is one of the log's files, also by another name, or would be among them; or if a file
            is where the folder is to be.
        """
        if self._place.exists() and not self._place.is_dir():
            raise OutputError(f"{self._folder}: is a file, not a folder; choose another folder, or remove it")
        self._sources = log_files(log)
        for file in self.files:
            for source in self._sources:
                if file.exists() and source.exists() and file.samefile(source):
                    raise OutputError(f"{file}: is a file of the log itself; choose another folder")
        if log.is_dir() and self._place.is_relative_to(log.resolve()):
            raise OutputError(f"{self._folder}: lies in the log; choose another folder")

    @contextmanager
    def prepared(
        self, facts: dict[str, Any], *, overwrite: bool, resume: bool
    ) -> Iterator[tuple[Path, Journal]]:
        """Provide a folder for the results, and the journal; on success all results are moved into place.

        Parameters
        ----------
        facts : dict
            What the analysis depends on. Those that are also in the summary show whether existing results
            are the same.
        overwrite : bool
            Whether existing results may be replaced.
        resume : bool
            Whether to continue a stopped run of the same facts.

        Raises
        ------
        OutputError
            If there are results already and they may not be replaced, another run is writing here, the
            journal is that of another run, or something cannot be written.
        AlreadyWholeError
            If the results to continue are already complete.
        """
        facts = json.loads(json.dumps(facts))
        replaced = self.files[-1].exists()
        with writing(self._folder):
            self._work.parent.mkdir(parents=True, exist_ok=True)
        with locked(
            self._lock,
            f"{self._folder}: another run is writing to this folder; wait for it, or name another folder",
        ):
            journal = Journal(self._journal, facts, self._kept(facts, overwrite, resume))
            try:
                with self._told_by_final_name(), journal:
                    self._begin()
                    yield self._work, journal
                    self._put_in_place()
            except BaseException as error:
                self._clean_up(journal.maps if _may_pass(error) else 0)
                raise
            self._clean_up()
            if replaced and (made := self._made_of_results()):
                logger.warning(
                    "%s: made of the results that were here before: %s; make them again or remove them",
                    self._folder,
                    listed(made, TOLD_MOST),
                    extra=UNCOUNTED,
                )

    def _begin(self) -> None:
        with writing(self._folder):
            if self._work.exists():  # of a run that was killed
                shutil.rmtree(self._work)
            self._work.mkdir()

    def _kept(self, facts: dict[str, Any], overwrite: bool, resume: bool) -> KeptMaps | None:
        """Look for what a stopped run has left to go on with."""
        kept = kept_maps(self._journal)
        differs = None if kept is None else difference(kept.facts, facts)
        if not overwrite and not (resume and kept and not differs and not self.files[-1].exists()):
            if resume and self._is_whole(facts):
                self._clean_up()
                raise AlreadyWholeError(f"{self._folder}: is whole already; nothing is left to do")
            refuse_existing(self.files, overwrite=False)
        if kept is None:
            return None
        if not resume:
            if not differs and kept.maps:
                logger.warning(
                    "%s: a run was stopped here after %d maps; resume=True would have gone on after them; "
                    "this one begins anew",
                    self._folder,
                    kept.maps,
                    extra=UNCOUNTED,
                )
            return None
        if differs:
            raise OutputError(
                f"{self._folder}: the run that was stopped here was another one ({differs}); "
                "leave out resume=True to begin anew"
            )
        if kept.maps:
            logger.warning(
                "%s: goes on after the %d maps that are done", self._folder, kept.maps, extra=UNCOUNTED
            )
        return kept

    def _is_whole(self, facts: dict[str, Any]) -> bool:
        """Whether all results are there and are those of these facts."""
        try:
            summary = json.loads(self.files[-1].read_text(encoding="utf-8"))
            same = all(summary[name] == value for name, value in facts.items() if name in summary)
        except (OSError, ValueError, TypeError):
            return False
        return same and all(file.exists() for file in self.files)

    def _put_in_place(self) -> None:
        # What is renamed must be on the disk: a name without its content is what a power failure would leave.
        for name in self._names:
            _sync(self._work / name)
        with writing(self._folder):
            if not self._place.exists():
                self._work.rename(self._place)
            else:
                for file in self._left_over():
                    file.unlink(missing_ok=True)
                (self._place / self._names[-1]).unlink(missing_ok=True)
                for name in self._names:
                    (self._work / name).replace(self._place / name)
        _sync(self._place)
        _sync(self._place.parent)

    def _left_over(self) -> list[Path]:
        """Results that only the earlier run has made, by its summary: they would pass for this one's."""
        try:
            earlier = json.loads((self._place / self._names[-1]).read_text(encoding="utf-8"))["files"]
            names = {str(name) for name in earlier}.difference(self._names)
        except (OSError, ValueError, KeyError, TypeError):
            return []
        files = [self._place / name for name in sorted(names) if Path(name).name == name]
        return [
            file
            for file in files
            if file.is_file() and not any(file.samefile(each) for each in self._sources if each.exists())
        ]

    def _made_of_results(self) -> list[str]:
        """Names of pages, figures and plans in the folder."""
        return sorted(file.name for file in self._place.iterdir() if MADE_OF_RESULTS.fullmatch(file.name))

    def _clean_up(self, kept_maps: int = 0) -> None:
        shutil.rmtree(self._work, ignore_errors=True)
        if kept_maps:
            logger.warning(
                "%s: %s done; resume=True goes on from there",
                self._folder,
                counted(kept_maps, "map"),
                extra=UNCOUNTED,
            )
        else:
            self._journal.unlink(missing_ok=True)

    @contextmanager
    def _told_by_final_name(self) -> Iterator[None]:
        """Let errors name the files as they are going to be."""
        try:
            yield
        except OutputError as error:
            text = str(error)
            if str(self._work) not in text:
                raise
            raise OutputError(text.replace(str(self._work), str(self._folder))) from error


def difference(before: dict[str, Any], now: dict[str, Any], prefix: str = "") -> str:
    """Name the first difference between two trees of values, or nothing."""
    for name in (*before, *(each for each in now if each not in before)):
        one, other = before.get(name), now.get(name)
        if isinstance(one, dict) and isinstance(other, dict):
            if found := difference(one, other, f"{prefix}{name}."):
                return found
        elif one != other:
            return f"{prefix}{name} was {one}, is {other}"
    return ""


def _may_pass(error: BaseException) -> bool:
    return not isinstance(error, Exception) or isinstance(error, MAY_PASS)


def _sync(path: Path) -> None:
    """Wait until a file or a folder is on the disk, where the system can tell."""
    if os.name == "nt":
        return  # it syncs neither folders nor files that are open for reading
    with writing(path):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

"""How far a segmentation stays the same when its map changes in a way that leaves the rooms as they are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from benchmarking.markdown import table
from benchmarking.transforms import TRANSFORMS
from rose2_logs.config.parameters import Parameters
from rose2_logs.evaluation.cases import Case
from rose2_logs.evaluation.scores import score
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.system.workers import ordered_map


@dataclass(frozen=True)
class Robustness:
    """Agreement of a map's segmentation with those of the changed maps.

    Attributes
    ----------
    group, name : str
        The case.
    iou_sym : dict
        For each transform, iou_sym between the changed labels and those found in the changed map, in percent.
    """

    group: str
    name: str
    iou_sym: Mapping[str, float]


class _InGroup(Protocol):
    @property
    def group(self) -> str: ...


Member = TypeVar("Member", bound=_InGroup)


def sampled(items: Sequence[Member], per_group: int | None) -> tuple[Member, ...]:
    """Take at most so many cases or maps of each group, spread evenly over it; all of them for None."""
    if per_group is None:
        return tuple(items)
    chosen: list[Member] = []
    for group in dict.fromkeys(item.group for item in items):
        members = [item for item in items if item.group == group]
        count = min(per_group, len(members))
        places = np.round(np.linspace(0, len(members) - 1, count)).astype(int)
        chosen.extend(members[place] for place in places.tolist())
    return tuple(chosen)


def check_robustness(
    cases: Sequence[Case], method: str, parameters: Parameters, workers: int = 1
) -> Iterator[Robustness]:
    """Compare each case's segmentation with itself under every transform; in the order of the cases."""
    check = partial(robustness_of, method=method, parameters=parameters)
    for _, result in ordered_map(check, cases, workers):
        yield result


def robustness_of(case: Case, method: str, parameters: Parameters) -> Robustness:
    """Compare one case's segmentation with itself under every transform."""
    snapshot = case.snapshot()
    labels = analyze(snapshot, parameters, method).rooms.labels
    agreement = {}
    for transform in TRANSFORMS:
        changed, expected = transform(snapshot, labels)
        agreement[transform.name] = agreement_of(expected, analyze(changed, parameters, method).rooms.labels)
    return Robustness(case.group, case.name, agreement)


def robustness_table(rows: Sequence[Robustness]) -> list[str]:
    """Return the lines of a table: mean and worst of each group under each transform."""
    cells = []
    for group in dict.fromkeys(row.group for row in rows):
        members = [row for row in rows if row.group == group]
        line = [f"{group} ({len(members)})"]
        for transform in TRANSFORMS:
            values = [row.iou_sym[transform.name] for row in members]
            line.append(f"{np.mean(values):.1f} / {min(values):.1f}")
        cells.append(line)
    return table(["group (maps)", *(transform.name for transform in TRANSFORMS)], cells)


def agreement_of(expected: NDArray[np.integer], found: NDArray[np.integer]) -> float:
    """iou_sym of two label images in percent; 100 where neither holds a room."""
    if not expected.any() and not found.any():
        return 100.0
    return score(expected, found).iou_sym

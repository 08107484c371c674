"""Which runs of many are of one building, and what differs between these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.comparison.layouts import LayoutComparison, compare_placed
from rose2_logs.comparison.placement import fits, place

PLACED_MOST = 60
"""Pairs of runs that are tried, as each takes about a second; beyond, runs are not compared."""


@dataclass
class Building:
    """A building of several runs.

    Attributes
    ----------
    reference : int
        Place of the run that shows most of it.
    others : dict
        What differs from it in the other runs, by their places.
    """

    reference: int
    others: dict[int, LayoutComparison] = field(default_factory=dict)


def same_buildings(layouts: Sequence[FinalLayout]) -> tuple[list[Building], list[int]]:
    """Group runs by the building that they show.

    Parameters
    ----------
    layouts : sequence of FinalLayout

    Returns
    -------
    buildings : list of Building
        Those that several runs show.
    left_out : list of int
        Places of the runs that were not tried with all others, as there are too many.
    """
    buildings: list[Building] = []
    left_out: list[int] = []
    tried = 0
    for number in sorted(range(len(layouts)), key=lambda each: (-float(layouts[each].areas_m2.sum()), each)):
        layout = layouts[number]
        for building in buildings:
            if tried == PLACED_MOST:
                left_out.append(number)
                break
            tried += 1
            reference = layouts[building.reference]
            placement = place(layout.map, reference.map)
            if placement is not None and fits(placement, reference.map.parameters.comparison):
                building.others[number] = compare_placed(reference, layout, placement)
                break
        else:
            buildings.append(Building(number))
    return [building for building in buildings if building.others], left_out

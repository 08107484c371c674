"""Tells of parameters that were set in vain: nothing that a command does asks for them."""

from __future__ import annotations

import logging

from rose2_logs.config.baselines import METHODS
from rose2_logs.config.parameters import Parameters
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

OF_EVERY_METHOD = ("occupancy", "topology", "quality")
"""Blocks that count wherever maps are segmented."""
OF_METHOD = {
    METHODS[0]: ("spectrum", "walls", "floor_plan", "regions"),
    "morphological": ("morphological",),
    "distance": ("distance",),
    "voronoi": ("voronoi", "voronoi_merge"),
}
"""Blocks that count with one method."""
COMPARING = ("spectrum", "tracking", "comparison")
"""Blocks that count where a layout is laid over another one."""
BY_ROSE2 = f"where maps are segmented (method={METHODS[0]!r})"
WHERE = {
    "reading": "where logs or saved maps are read",
    "mapping": "where maps are built from scans (map_from='/scan')",
    "tracking": "where rooms are followed from map to map",
    "kinds": "where a run is stored",
    "comparison": "where two layouts are compared",
    **dict.fromkeys(OF_EVERY_METHOD, "where maps are segmented"),
    **dict.fromkeys(OF_METHOD[METHODS[0]], BY_ROSE2),
    **{
        block: f"where maps are segmented (method={method!r})"
        for method in METHODS[1:]
        for block in OF_METHOD[method]
    },
}
"""Where the parameters of each block count."""


def following(*, built: bool) -> tuple[str, ...]:
    """Name the blocks that count where rooms are followed, in maps that are built from scans or may be."""
    return ("reading", "tracking", *(["mapping"] if built else []))


def tell_without_effect(parameters: Parameters, *read: str, method: str | None = None) -> None:
    """Warn of each parameter that was set, but that nothing asks for.

    Parameters
    ----------
    parameters : Parameters
        Those that were given.
    *read : str
        Blocks that count here, besides those of the method.
    method : str, optional
        The segmentation method; by default nothing is segmented.
    """
    asked = set(read)
    if method is not None:
        asked.update(OF_EVERY_METHOD, OF_METHOD[method])
    for name, where in WHERE.items():
        block = getattr(parameters, name)
        changed = block.changed()
        if name not in asked:
            implied = {other for each in changed for other in block.implied.get(each, ())}
            vain = {each: where for each in changed if each not in implied}
        elif method in METHODS[1:]:
            # Of a block for every method, what depends on the grouping of the floor plan.
            vain = {each: BY_ROSE2 for each in changed if each in block.groupings}
        else:
            continue
        for each, counts in vain.items():
            log_warning(logger, "no_effect", f"{name}.{each} has no effect here; it counts {counts}")
    if method == METHODS[0]:
        for text in parameters.without_effect():
            log_warning(logger, "no_effect", text)

"""Features of a join, from the sums of its two regions and their border."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import FloatArray
from rose2_logs.segmentation.regions.graph import (
    BORDER_MAXIMA,
    BORDER_SUMS,
    NODE_MAXIMA,
    NODE_SUMS,
    RegionGraph,
)

SHAPE_FEATURES = (
    "log_contact", "contact_per_outline_small", "contact_per_outline_large", "contact_per_side_small",
    "openness", "straightness", "log_chord", "on_face", "line_short", "line_middle", "line_long",
    "saddle", "saddle_per_clear_low", "saddle_per_clear_high", "mean_clear_per_saddle",
    "strong_saddle", "strong_saddle_per_clear_low", "strong_saddle_per_clear_high",
    "log_area_small", "log_area_large", "area_ratio",
    "rectangle_small", "rectangle_large", "rectangle_union", "rectangle_gain",
    "octagon_small", "octagon_large", "octagon_union", "octagon_gain",
    "wall_share_small", "wall_share_large", "unknown_share_small", "unknown_share_large",
    "elongation_small", "elongation_large", "elongation_union", "aligned",
    "spans_small", "spans_large", "neighbors_small", "neighbors_large", "wide_small", "wide_large",
)  # fmt: skip
ANSWER_FEATURES = (
    "different_near", "different_middle", "different_far", "different", "log_pairs",
    "outside_small", "outside_large",
)  # fmt: skip
FEATURES = SHAPE_FEATURES + ANSWER_FEATURES
NO_ANSWER = -1.0
CONTACT_MIN_M = 0.05
"""Regions that touch along less, but face one another across noise, may still be joined."""
FACING_MIN_M = 0.3
"""Regions that face one another along this much, with nothing known between, may be joined, too."""
NEIGHBOR_MIN_M = 0.1
"""Regions that touch along more count as neighbors of one another."""
OCTAGON_CORNER = 0.5
"""Area that an octagon's slanting side cuts off a corner, per squared distance of the side from it."""
LEAST_M, LEAST_M2 = 0.01, 0.01
"""Added to lengths and areas, or the least of them, so that no logarithm is of zero and no divisor is."""
LOG_LENGTH_M = 0.05
"""Added to lengths before their logarithm, half a cell of the plan frame, as a contact may be 0."""
CLEAR_LEAST_M = 0.02
"""Added to clearances that are divided by: that of a region that no cell of the plan frame meets is 0."""
MOST_STRAIGHTNESS = 4.0
"""Straightness of a border is at most this: its length along the axes per distance between its ends."""
MOST_SADDLE_M = 4.0
"""Clearance of a passage is at most this: what is twice as wide is no passage."""
MOST_SADDLE_SHARE = 1.5
"""Clearance of a passage is at most this share of a region's."""


def joinable(graph: RegionGraph) -> NDArray[np.bool_]:
    """Borders (M,) along which regions touch, or face one another with nothing known between."""
    contact = _contact(graph)
    facing = graph.border_sums[:, BORDER_SUMS.index("facing_unknown")]
    can: NDArray[np.bool_] = (contact >= CONTACT_MIN_M) | (facing >= FACING_MIN_M)
    return can


def join_features(graph: RegionGraph, which: NDArray[np.intp]) -> FloatArray:
    """Features (K, len(FEATURES)) of the borders of the given numbers (K,)."""
    area = graph.node_sums[:, NODE_SUMS.index("area")]
    ends = graph.ends[which]
    swap = area[ends[:, 0]] > area[ends[:, 1]]
    small, large = np.where(swap, ends[:, 1], ends[:, 0]), np.where(swap, ends[:, 0], ends[:, 1])
    columns = [
        *_contact_columns(graph, which, small, large),
        *_clearance_columns(graph, which, small, large),
        *_form_columns(graph, which, small, large),
        *_answer_columns(graph, which, small, large),
    ]
    return np.stack(columns, axis=1)


def _named(values: FloatArray, names: tuple[str, ...]) -> dict[str, FloatArray]:
    return {name: values[:, k] for k, name in enumerate(names)}


def _contact_columns(
    graph: RegionGraph, which: NDArray[np.intp], small: NDArray[np.int64], large: NDArray[np.int64]
) -> list[FloatArray]:
    """How two regions meet: from `log_contact` to `line_long`."""
    n = _named(graph.node_sums, NODE_SUMS)
    s, m = _named(graph.border_sums[which], BORDER_SUMS), _named(graph.border_maxima[which], BORDER_MAXIMA)
    outline = _outline(graph)
    contact = s["upright"] + s["level"]
    per_contact = np.where(contact > 0, 1 / np.maximum(contact, 1e-9), 0.0)
    width, height = (np.where(contact > 0, m[f"{a}_high"] + m[f"{a}_low"], 0.0) for a in "xy")
    chord = np.hypot(width, height) + LEAST_M
    side = np.hypot(s["upright"], s["level"])
    facing = s["facing_wall"] + s["facing_unknown"]
    return [
        np.log(contact + LOG_LENGTH_M),
        contact / outline[small],
        contact / outline[large],
        side / np.sqrt(n["area"][small]),
        contact / (contact + facing + LEAST_M),
        np.minimum(side / chord, MOST_STRAIGHTNESS),
        np.log(chord + LOG_LENGTH_M),
        s["on_face"] * per_contact,
        s["line_0"] * per_contact,
        s["line_1"] * per_contact,
        s["line_2"] * per_contact,
    ]


def _clearance_columns(
    graph: RegionGraph, which: NDArray[np.intp], small: NDArray[np.int64], large: NDArray[np.int64]
) -> list[FloatArray]:
    """How narrow the passage is: from `saddle` to `strong_saddle_per_clear_high`."""
    top = _named(graph.node_maxima, NODE_MAXIMA)
    s, m = _named(graph.border_sums[which], BORDER_SUMS), _named(graph.border_maxima[which], BORDER_MAXIMA)
    contact = s["upright"] + s["level"]
    per_contact = np.where(contact > 0, 1 / np.maximum(contact, 1e-9), 0.0)
    columns = []
    for saddle_name, clear_name in (("saddle", "clear"), ("saddle_strong", "clear_strong")):
        saddle = np.minimum(np.where(contact > 0, m[saddle_name], 0.0), MOST_SADDLE_M)
        low = np.minimum(top[clear_name][small], top[clear_name][large])
        high = np.maximum(top[clear_name][small], top[clear_name][large])
        shares = [np.minimum(saddle / (clear + CLEAR_LEAST_M), MOST_SADDLE_SHARE) for clear in (low, high)]
        columns += [saddle, *shares]
        if saddle_name == "saddle":
            columns.append(s["clear"] * per_contact / (saddle + CLEAR_LEAST_M))
    return columns


def _form_columns(
    graph: RegionGraph, which: NDArray[np.intp], small: NDArray[np.int64], large: NDArray[np.int64]
) -> list[FloatArray]:
    """Sizes and forms of two regions and of what they would be together: from `log_area_small` on."""
    n, s = _named(graph.node_sums, NODE_SUMS), _named(graph.border_sums[which], BORDER_SUMS)
    outline, neighbors = _outline(graph), _at_ends(graph, (_contact(graph) > NEIGHBOR_MIN_M).astype(float))
    box = _boxes(graph.node_maxima)
    box_small, box_large = box[small], box[large]
    union_maxima = np.maximum(graph.node_maxima[small], graph.node_maxima[large])
    box_union = _boxes(union_maxima)
    octagon = _octagons(graph.node_maxima)
    area_small, area_large = n["area"][small], n["area"][large]
    area = area_small + area_large
    rectangle = [area_small / box_small[:, 2], area_large / box_large[:, 2], area / box_union[:, 2]]
    eight = [area_small / octagon[small], area_large / octagon[large], area / _octagons(union_maxima)]

    def gain(fills: list[FloatArray]) -> FloatArray:
        return fills[2] - (area_small * fills[0] + area_large * fills[1]) / area

    def lies(boxes: FloatArray) -> FloatArray:
        return np.log(boxes[:, 0] / boxes[:, 1])

    # A border that takes the whole side of a region leaves no wall beside it.
    spans = [np.maximum(s["upright"] / b[:, 1], s["level"] / b[:, 0]) for b in (box_small, box_large)]
    return [
        np.log(area_small + LEAST_M2),
        np.log(area_large + LEAST_M2),
        area_small / area_large,
        *rectangle,
        gain(rectangle),
        *eight,
        gain(eight),
        n["wall_edges"][small] / outline[small],
        n["wall_edges"][large] / outline[large],
        n["unknown_edges"][small] / outline[small],
        n["unknown_edges"][large] / outline[large],
        np.abs(lies(box_small)),
        np.abs(lies(box_large)),
        np.abs(lies(box_union)),
        lies(box_small) * lies(box_large),
        spans[0],
        spans[1],
        neighbors[small],
        neighbors[large],
        n["wide"][small] / area_small,
        n["wide"][large] / area_large,
    ]


def _answer_columns(
    graph: RegionGraph, which: NDArray[np.intp], small: NDArray[np.int64], large: NDArray[np.int64]
) -> list[FloatArray]:
    """What the network says: from `different_near` on."""
    n, s = _named(graph.node_sums, NODE_SUMS), _named(graph.border_sums[which], BORDER_SUMS)
    different = np.stack([s[f"different_{k}"] for k in range(3)])
    pairs = np.stack([s[f"pairs_{k}"] for k in range(3)])
    return [
        *(_ratio(d, p) for d, p in zip(different, pairs, strict=True)),
        _ratio(different.sum(0), pairs.sum(0)),
        np.log(pairs.sum(0) + 1),
        n["outside"][small] / n["area"][small],
        n["outside"][large] / n["area"][large],
    ]


def _contact(graph: RegionGraph) -> FloatArray:
    """Length (M,) along which the regions of each border touch."""
    s = _named(graph.border_sums, BORDER_SUMS)
    contact: FloatArray = s["upright"] + s["level"]
    return contact


def _outline(graph: RegionGraph) -> FloatArray:
    """Length (N,) of the outline of each region."""
    n = _named(graph.node_sums, NODE_SUMS)
    outline: FloatArray = n["wall_edges"] + n["unknown_edges"] + _at_ends(graph, _contact(graph)) + LEAST_M
    return outline


def _at_ends(graph: RegionGraph, values: FloatArray) -> FloatArray:
    """Sum (N,) over the borders (M,) of each region."""
    count = len(graph.node_sums)
    one, other = (np.bincount(graph.ends[:, k], values, minlength=count) for k in (0, 1))
    total: FloatArray = np.asarray(one + other, float)
    return total


def _ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
    return np.where(whole > 0, part / np.maximum(whole, 1e-9), NO_ANSWER)


def _boxes(maxima: FloatArray) -> FloatArray:
    """Width, height, area (K, 3) of the boxes along the plan frame's axes."""
    m = _named(maxima, NODE_MAXIMA)
    width, height = (np.maximum(m[f"{a}_high"] + m[f"{a}_low"], LEAST_M) for a in "xy")
    return np.stack([width, height, width * height], axis=1)


def _octagons(maxima: FloatArray) -> FloatArray:
    """Area (K,) of the octagons along the axes and the diagonals."""
    _, _, x1, x0, y1, y0, s1, s0, d1, d0 = maxima.T
    area = (x1 + x0) * (y1 + y0)
    for cut in (x1 + y1 - s1, x0 + y0 - s0, x1 + y0 - d1, x0 + y1 - d0):
        area = area - OCTAGON_CORNER * np.maximum(cut, 0.0) ** 2
    least: FloatArray = np.maximum(area, LEAST_M2)
    return least


REGION_FEATURES = (
    "log_area", "outside", "clear", "clear_strong", "wall_share", "unknown_share", "open_share", "wide",
    "rectangle", "octagon", "area_share",
)  # fmt: skip
"""Features that tell rooms from rays and the outside."""


def region_features(graph: RegionGraph) -> FloatArray:
    """Features (N, len(REGION_FEATURES)) of the regions of a graph."""
    n, top = _named(graph.node_sums, NODE_SUMS), _named(graph.node_maxima, NODE_MAXIMA)
    open_edges, outline, area = _at_ends(graph, _contact(graph)), _outline(graph), n["area"]
    columns = [
        np.log(area + LEAST_M2),
        n["outside"] / area,
        top["clear"],
        top["clear_strong"],
        n["wall_edges"] / outline,
        n["unknown_edges"] / outline,
        open_edges / outline,
        n["wide"] / area,
        area / _boxes(graph.node_maxima)[:, 2],
        area / _octagons(graph.node_maxima),
        area / area.sum(),
    ]
    return np.stack(columns, axis=1)

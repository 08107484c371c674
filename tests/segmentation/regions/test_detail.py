"""One tree of joins gives the rooms at any detail; more detail never joins what less detail parts."""

from __future__ import annotations

import dataclasses
import itertools
import pickle

import numpy as np
import pytest
from drawn_maps import office, snapshot
from finished_runs import SAMPLE_LOGS

import rose2_logs as rl
from rose2_logs.config.regions import RegionParameters
from rose2_logs.model.labels import narrow_labels
from rose2_logs.segmentation.pipeline import RoomTree, analyze_with_tree
from rose2_logs.segmentation.regions import stage
from rose2_logs.segmentation.regions.graph import (
    BORDER_MAXIMA,
    BORDER_SUMS,
    NODE_MAXIMA,
    NODE_SUMS,
    RegionGraph,
)
from rose2_logs.segmentation.regions.joining import Joins
from rose2_logs.segmentation.regions.stage import RegionTree

DETAILS = (-20.0, -6.0, -2.0, -0.5, 0.0, 0.5, 2.0, 6.0, 20.0)


def erratic(features: np.ndarray) -> np.ndarray:
    """Strengths that a join changes in both directions, by much."""
    return 15 * np.sin(1e3 * features.sum(1))


@pytest.fixture(scope="module")
def grown() -> RoomTree:
    """The tree of a drawn office with clutter, which makes many atoms."""
    _, tree = analyze_with_tree(snapshot(office(clutter=25)[0]))
    assert tree is not None
    return tree


@pytest.mark.parametrize("strength", [None, erratic], ids=["fitted", "erratic"])
def test_more_detail_never_joins_what_less_detail_parts(grown: RoomTree, strength):
    tree = grown.tree
    if strength is not None:
        tree = dataclasses.replace(tree, strength=strength)
    found = [tree.rooms(detail).labels for detail in DETAILS]
    of_atoms = tree.cells > 0
    for coarse, fine in itertools.pairwise(found):
        both = of_atoms & (coarse > 0) & (fine > 0)
        pairs = np.unique(np.column_stack([fine[both], coarse[both]]), axis=0)
        assert len(np.unique(pairs[:, 0])) == len(pairs)
    assert found[0].max() < found[-1].max()


@pytest.fixture(scope="module", params=["office.mcap", "ring", "wing.bag"])
def last_map(request) -> tuple[rl.Snapshot, RoomTree]:
    with rl.open_log(SAMPLE_LOGS / request.param) as reader:
        last = reader.last()
    tree = analyze_with_tree(last)[1]
    assert tree is not None
    return last, tree


def test_more_detail_joins_at_most_what_is_no_room_by_itself(last_map):
    """Of the maps of the sample logs: floor that is cut off, too small for a room, may change its room."""
    last, tree = last_map
    found = [tree.tree.rooms(detail).labels for detail in DETAILS]
    for coarse, fine in itertools.pairwise(found):
        both = (coarse > 0) & (fine > 0)
        overlap = np.zeros((fine.max() + 1, coarse.max() + 1))
        np.add.at(overlap, (fine[both], coarse[both]), last.geometry.cell_area_m2)
        assert np.sort(overlap, axis=1)[:, -2].max() < tree.parameters.regions.room_min_area_m2
        assert fine.max() >= coarse.max()


def test_no_room_is_narrow_at_any_detail(last_map):
    last, tree = last_map
    cell_m, regions = last.geometry.resolution_m, tree.parameters.regions
    for detail in DETAILS:
        labels = tree.rooms(detail).rooms.labels
        limits = regions.room_min_width_m / cell_m, regions.speck_max_m / cell_m
        assert not narrow_labels(labels, int(labels.max()), *limits).any()


def test_detail_parts_surer_joins_step_by_step(grown: RoomTree):
    """At the least detail all that touches is joined, at the greatest no atom is."""
    atoms = len(grown.tree.graph.node_sums)
    parameters = dataclasses.replace(
        grown.tree.parameters, room_min_area_m2=0.0, small_room_max_m2=0.0, outside_max_share=0.0
    )
    tree = dataclasses.replace(grown.tree, strength=lambda features: np.zeros(len(features)) + 1.0)
    tree = dataclasses.replace(tree, parameters=parameters)
    assert tree.rooms(1.1).labels.max() == atoms
    assert tree.rooms(0.9).labels.max() < atoms
    doubtful = dataclasses.replace(tree, strength=lambda features: np.zeros(len(features)) - 1.0)
    assert doubtful.rooms(-0.9).labels.max() == atoms
    assert doubtful.rooms(-1.1).labels.max() < atoms


@pytest.mark.parametrize("detail", [-3.0, 0.0, 4.0])
def test_another_detail_of_a_segmented_map_is_as_if_it_was_segmented_so(detail: float):
    """Also where the tree is gone, as after a way between processes."""
    drawn = snapshot(office(clutter=25)[0])
    found, wanted = rl.segment(drawn), rl.segment(drawn, detail=detail)
    copied = pickle.loads(pickle.dumps(found))
    for other in (found.at_detail(detail), copied.at_detail(detail), found.at_detail(9).at_detail(detail)):
        assert np.array_equal(other.labels, wanted.labels)
        assert other.borders == wanted.borders
        assert other.parameters == wanted.parameters
        assert np.array_equal(other.quality.wall_support, wanted.quality.wall_support, equal_nan=True)
        assert np.array_equal(other.floor_plan.room_of_face, wanted.floor_plan.room_of_face)
        assert other.outside_m2 == wanted.outside_m2


def test_no_detail_is_the_one_there_is():
    found = rl.segment(snapshot(office(clutter=25)[0]), detail=4.0)
    assert np.array_equal(found.at_detail(None).labels, found.labels)


@pytest.mark.parametrize(
    ("options", "detail"),
    [
        ({"method": "voronoi"}, 1.0),
        ({"parameters": {"floor_plan.grouping": "walls"}}, 1.0),
        ({}, 20.1),
        ({}, float("nan")),
    ],
)
def test_a_detail_that_cannot_be_had_is_refused(options: dict[str, object], detail: float):
    drawn = snapshot(office()[0])
    with pytest.raises(rl.ParameterError, match="detail="):
        rl.segment(drawn, detail=detail, **options)
    with pytest.raises(rl.ParameterError, match="detail="):
        rl.segment(drawn, **options).at_detail(detail)


def test_a_pickled_segmentation_leaves_the_tree_behind():
    found = rl.segment(snapshot(office()[0]))
    assert pickle.loads(pickle.dumps(found))._tree is None
    assert found._tree is not None


def test_what_is_outside_is_so_at_any_detail():
    """A drawing with white around it: at less detail the offices do not join the white and go with it."""
    cells = np.pad(office()[0], 60, constant_values=0)
    cells[cells < 0] = 0
    _, grown = analyze_with_tree(snapshot(cells))
    assert grown is not None
    atoms, tree = grown.tree.cells > 0, grown.tree
    outside_m2 = {detail: tree.rooms(detail).outside_m2 for detail in DETAILS}
    assert outside_m2[0.0] > 30
    assert set(outside_m2.values()) == {outside_m2[0.0]}
    in_room = [(tree.rooms(detail).labels > 0) & atoms for detail in (-20.0, 0.0)]
    assert np.array_equal(*in_room)


@pytest.mark.parametrize("order", ["NS", "SN"])
def test_narrow_floor_beside_no_room_stays_a_room_whatever_its_number(order: str, monkeypatch):
    """At more detail a room of 0.75 m is parted into a strip of 1.35 m2 and one too small for a room."""
    monkeypatch.setattr(stage, "small_region_joins", lambda graph, *_: no_joins(graph))
    monkeypatch.setattr(
        RegionTree, "_outside_of", lambda self, graph, *_: np.zeros(len(graph.node_sums), bool)
    )
    columns = {"N": slice(10, 19), "S": slice(19, 25)}
    cells = np.zeros((80, 60), np.int32)
    for number, name in enumerate(order, start=1):
        cells[10:70, columns[name]] = number
    sums = np.zeros((2, len(NODE_SUMS)))
    sums[:, 0] = [np.count_nonzero(cells == number) * 0.05**2 for number in (1, 2)]
    graph = RegionGraph(
        sums,
        np.ones((2, len(NODE_MAXIMA))),
        np.array([[0, 1]]),
        np.ones((1, len(BORDER_SUMS))),
        np.ones((1, len(BORDER_MAXIMA))),
    )
    tree = RegionTree(
        cells, cells > 0, 0.05, graph, np.zeros(2), lambda f: np.ones(len(f)), RegionParameters()
    )
    for detail in (0.0, 0.5, 2.0):
        assert (tree.rooms(detail).labels > 0).sum() == (cells > 0).sum()


def no_joins(graph: RegionGraph) -> Joins:
    return Joins(len(graph.node_sums), np.zeros((0, 2), np.int64), np.zeros(0))

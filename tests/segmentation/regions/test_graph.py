"""The graph of regions: sums and maxima that follow from those of the atoms, whatever is joined."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rose2_logs.segmentation.regions.features import (
    FEATURES,
    REGION_FEATURES,
    join_features,
    joinable,
    region_features,
)
from rose2_logs.segmentation.regions.graph import (
    BORDER_MAXIMA,
    BORDER_SUMS,
    NODE_MAXIMA,
    NODE_SUMS,
    build_graph,
)
from rose2_logs.segmentation.regions.plan_raster import OUTPUTS, PlanRaster

CELL_M = 0.1


def drawn_graph(rows, answers=None):
    """Graph of atoms drawn as digits; ``#`` is wall, ``.`` unknown."""
    image = np.array([list(row) for row in rows])
    wall, known = image == "#", (image != "#") & (image != ".")
    atoms = np.where(known, image, "0").astype(np.int32)
    raster = PlanRaster(wall.astype(np.uint8) * 9, known.astype(np.uint8) * 9)
    nothing = np.zeros(image.shape, np.int32)
    return build_graph(atoms, raster, wall, nothing, answers, CELL_M, int(atoms.max()))


def column(values, names, name):
    return values[:, names.index(name)]


def test_a_drawn_graph_has_the_areas_and_contacts_of_the_drawing():
    graph = drawn_graph(["1111#222", "1111#222", "11112222", "33333333"])
    assert column(graph.node_sums, NODE_SUMS, "area") == pytest.approx([0.12, 0.10, 0.08])
    assert graph.ends.tolist() == [[0, 1], [0, 2], [1, 2]]
    assert column(graph.border_sums, BORDER_SUMS, "upright") == pytest.approx([0.1, 0, 0])
    assert column(graph.border_sums, BORDER_SUMS, "level") == pytest.approx([0, 0.4, 0.4])
    facing = column(graph.border_sums, BORDER_SUMS, "facing_wall")
    assert facing[0] > 0
    assert column(graph.node_maxima, NODE_MAXIMA, "x_high") == pytest.approx([0.4, 0.8, 0.8])
    assert column(graph.border_maxima, BORDER_MAXIMA, "y_high")[0] == pytest.approx(0.3)


def test_regions_that_face_one_another_across_what_is_not_known_may_be_joined_and_across_a_wall_not():
    unknown = drawn_graph(["1111..2222"] * 4)
    wall = drawn_graph(["1111##2222"] * 4)
    assert joinable(unknown).tolist() == [True]
    assert joinable(wall).tolist() == [False]


def test_answers_are_summed_over_the_pairs_of_cells_of_a_border():
    answers = np.zeros((OUTPUTS, 4, 8), np.float32)
    answers[0] = 0.5
    graph = drawn_graph(["11112222"] * 4, answers)
    # Two columns of pairs two cells apart lie across the border.
    assert column(graph.border_sums, BORDER_SUMS, "pairs_0") == pytest.approx([8])
    assert column(graph.border_sums, BORDER_SUMS, "different_0") == pytest.approx([4])


@pytest.mark.parametrize("rows", [["12"], ["1"] * 3, ["11112222"], ["1"]])
def test_maps_narrower_than_the_pairs_that_are_asked_about_have_a_graph(rows):
    answers = np.zeros((OUTPUTS, len(rows), len(rows[0])), np.float32)
    graph = drawn_graph(rows, answers)
    assert len(graph.ends) == len({cell for row in rows for cell in row}) - 1


def test_an_atom_that_no_plan_cell_shows_is_in_the_graph():
    atoms = np.ones((4, 4), np.int32)
    raster = PlanRaster(np.zeros((4, 4), np.uint8), np.full((4, 4), 9, np.uint8))
    graph = build_graph(atoms, raster, atoms > 5, atoms, None, CELL_M, 3)
    assert len(graph.node_sums) == 3
    assert np.isfinite(region_features(graph)).all()


@given(st.data())
@settings(max_examples=20)
def test_sums_of_joined_regions_are_those_of_the_joined_atoms(atoms, answers, data):
    """Whatever is joined, the graph is the one that is built from the joined regions."""
    graph = atoms.graph(answers)
    number = st.integers(0, atoms.count - 1)
    root = np.array(data.draw(st.lists(number, min_size=atoms.count, max_size=atoms.count)))
    root = np.unique(root, return_inverse=True)[1]
    joined, border = graph.joined(root)
    relabeled = np.concatenate([[0], root + 1])[atoms.on_plan].astype(np.int32)
    again = build_graph(
        relabeled,
        atoms.raster,
        atoms.strong,
        atoms.faces_on_plan,
        answers,
        atoms.frame.cell_m,
        root.max() + 1,
    )
    assert np.array_equal(joined.ends, again.ends)
    for name in ("node_sums", "node_maxima", "border_sums", "border_maxima"):
        np.testing.assert_allclose(getattr(joined, name), getattr(again, name), atol=1e-4, err_msg=name)
    assert set(border[border >= 0]) == set(range(len(joined.ends)))


def test_features_are_finite_with_answers_and_without(atoms, answers):
    for given_answers in (answers, None):
        graph = atoms.graph(given_answers)
        which = np.flatnonzero(joinable(graph))
        features = join_features(graph, which)
        assert features.shape == (len(which), len(FEATURES))
        assert np.isfinite(features).all()
        of_regions = region_features(graph)
        assert of_regions.shape == (atoms.count, len(REGION_FEATURES))
        assert np.isfinite(of_regions).all()


def test_features_do_not_hang_on_which_region_has_the_lower_number():
    one, other = (
        drawn_graph(["111111222"] * 5 + ["#########"]),
        drawn_graph(["222222111"] * 5 + ["#########"]),
    )
    first = np.array([0])
    np.testing.assert_allclose(join_features(one, first), join_features(other, first), atol=1e-9)


@pytest.mark.parametrize(("rows", "small", "large"), [(["1112222222"], 3, 7), (["2221111111"], 3, 7)])
def test_the_smaller_region_is_the_small_one_whatever_its_number(rows, small, large):
    features = join_features(drawn_graph(rows), np.array([0]))
    areas = np.exp([column(features, FEATURES, f"log_area_{name}")[0] for name in ("small", "large")]) - 0.01
    assert areas == pytest.approx([small * CELL_M**2, large * CELL_M**2])

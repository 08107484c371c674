"""What ships as data: the files are those of the manifest, small, and fit the code."""

import numpy as np
import pytest

from rose2_logs.segmentation.regions import fitted
from rose2_logs.segmentation.regions.features import FEATURES, REGION_FEATURES, SHAPE_FEATURES
from rose2_logs.segmentation.regions.own_rooms import OWN_ROOM_FEATURES
from rose2_logs.segmentation.regions.plan_raster import OUTPUTS, PlanRaster

NETWORK_MAX_BYTES = 1_500_000


def test_files_are_those_of_the_manifest():
    listed = fitted.manifest()["sha256"]
    assert set(listed) == set(fitted.FILES)
    for name, expected in listed.items():
        assert fitted.sha256_of(fitted.FOLDER / name) == expected, name


def test_manifest_tells_how_they_were_fitted():
    facts = fitted.manifest()
    assert facts["real buildings"] >= 40
    assert facts["simulated maps for the network"] >= 4000
    assert facts["folds"] == 3


def test_network_is_small_enough_to_ship():
    assert (fitted.FOLDER / fitted.NETWORK).stat().st_size <= NETWORK_MAX_BYTES


def test_network_answers_at_any_size_with_rounded_probabilities():
    rng = np.random.default_rng(0)
    for height, width in ((1, 1), (33, 70), (64, 64)):
        wall = (rng.random((height, width)) < 0.1).astype(np.uint8) * 9
        answers = fitted.answering_network()(PlanRaster(wall, (9 - wall).astype(np.uint8)))
        assert answers.shape == (OUTPUTS, height, width)
        assert answers.min() >= 0
        assert answers.max() <= 1
        np.testing.assert_allclose(answers * 1000, np.rint(answers * 1000), atol=1e-3)


@pytest.mark.parametrize(
    ("trees", "names"),
    [
        (fitted.join_trees, FEATURES),
        (fitted.outside_trees, REGION_FEATURES),
        (fitted.own_room_trees, OWN_ROOM_FEATURES),
    ],
    ids=["joins", "outside", "own rooms"],
)
def test_trees_ask_only_for_features_there_are(trees, names):
    found = trees()
    assert len(found.feature) > 0
    assert found.feature.max() < len(names)
    assert np.isfinite(found(np.zeros((3, len(names))))).all()


def test_joins_ask_for_shapes_alone():
    """The network is summed up with the trees; its answers are not features of them."""
    assert fitted.join_trees().feature.max() < len(SHAPE_FEATURES)

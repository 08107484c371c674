"""The fitted strength: trees as arrays, and the network's answers beside them."""

import numpy as np
import pytest

from rose2_logs.segmentation.regions import fitted
from rose2_logs.segmentation.regions.features import FEATURES, NO_ANSWER, REGION_FEATURES
from rose2_logs.segmentation.regions.strengths import (
    DIFFERENT,
    LEAVES_MAX,
    BoostedTrees,
    FittedStrength,
    read_trees,
)

NAMES = ("width", "height")


def hand_made():
    """Two trees: width up to 1 gives -1, else height up to 2 gives 2, else 3; and 0.5 for everything."""
    return BoostedTrees(
        feature=np.array([[0, 0, 1, 0, 0], [0, 0, 0, 0, 0]]),
        threshold=np.array([[1.0, np.inf, 2.0, np.inf, np.inf], [np.inf] * 5]),
        left=np.array([[1, 1, 3, 3, 4], [0, 1, 2, 3, 4]]),
        right=np.array([[2, 1, 4, 3, 4], [0, 1, 2, 3, 4]]),
        value=np.array([[0.0, -1.0, 0.0, 2.0, 3.0], [0.5, 0, 0, 0, 0]]),
        start=10.0,
    )


def test_hand_made_trees_answer_as_they_were_made():
    asked = np.array([(0.0, 9.0), (1.0, 9.0), (1.1, 2.0), (1.1, 2.1)])
    assert hand_made()(asked).tolist() == [9.5, 9.5, 12.5, 13.5]


def test_one_leaf_answers_the_same_to_everything():
    trees = BoostedTrees.constant(-2.0)
    assert trees(np.zeros((3, 4))).tolist() == [-2, -2, -2]
    assert trees(np.zeros((0, 4))).shape == (0,)


def chain(leaves):
    """One tree that sends k < x <= k + 1 to a leaf of value k + 1, up to the last leaf."""
    inner = np.arange(leaves - 1)
    own = np.arange(2 * leaves - 1)
    left, right, threshold = own.copy(), own.copy(), np.full(len(own), np.inf)
    left[inner], right[inner], threshold[inner] = leaves - 1 + inner, np.append(inner[1:], own[-1]), inner
    value = np.where(own < leaves - 1, 0.0, own - (leaves - 1))
    return BoostedTrees(
        np.zeros((1, len(own)), int), threshold[None], left[None], right[None], value[None], 0
    )


def test_trees_have_as_many_leaves_as_there_are_bits():
    asked = np.arange(20.0)[:, None]
    assert chain(LEAVES_MAX)(asked).tolist() == np.minimum(asked[:, 0], LEAVES_MAX - 1).tolist()
    with pytest.raises(ValueError, match="17 leaves; 16 is the most"):
        chain(LEAVES_MAX + 1)(asked)


def test_trees_of_other_features_are_refused(tmp_path):
    trees = hand_made()
    path = tmp_path / "trees.npz"
    arrays = {name: getattr(trees, name) for name in ("feature", "threshold", "left", "right", "value")}
    np.savez(path, names=np.array(NAMES), start=trees.start, **arrays)
    asked = np.random.default_rng(0).uniform(0, 3, (50, 2))
    assert np.array_equal(read_trees(path, NAMES)(asked), trees(asked))
    with pytest.raises(ValueError, match="fitted on other features"):
        read_trees(path, NAMES[::-1])


def features(*different):
    rows = np.zeros((len(different), len(FEATURES)))
    rows[:, DIFFERENT] = different
    return rows


def test_strength_weighs_trees_and_answers():
    answers_alone = FittedStrength(None, DIFFERENT, answer_weight=1.0, answer_least=0.1)
    surest = round(np.log(11), 3)
    np.testing.assert_allclose(
        answers_alone(features(0.0, 0.5, 1.0, NO_ANSWER)), [surest, 0.0, -surest, -surest]
    )
    both = FittedStrength(BoostedTrees.constant(3.0), DIFFERENT, answer_weight=0.5, answer_least=1e-9)
    np.testing.assert_allclose(both(features(0.2, 0.8)), (3 + np.log([4, 1 / 4]) / 2) / 1.5, atol=5e-4)
    trees_alone = FittedStrength(BoostedTrees.constant(3.0), DIFFERENT, answer_weight=0.0, answer_least=0.1)
    np.testing.assert_allclose(trees_alone(features(0.0, NO_ANSWER)), [3.0, 3.0])


def test_strengths_that_differ_by_rounding_errors_are_equal():
    strength = FittedStrength(None, DIFFERENT, answer_weight=1.0, answer_least=0.001)
    one, other = strength(features(0.3, np.nextafter(0.3, 1) + 1e-9))
    assert one == other


def test_what_was_fitted_can_be_read():
    assert fitted.join_trees()(np.zeros((2, len(FEATURES)))).shape == (2,)
    assert fitted.outside_trees()(np.zeros((2, len(REGION_FEATURES)))).shape == (2,)

"""Options of a run: each checks itself, and says what depends on it."""

from __future__ import annotations

import dataclasses
import math

import pytest

from rose2_logs.batch.options import BatchOptions
from rose2_logs.config.baselines import METHODS
from rose2_logs.config.run_options import RECORDING_LAYERS, RunOptions, layers_named, options_of
from rose2_logs.errors import ParameterError
from rose2_logs.segmentation.baselines.stage import BASELINES


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"start_s": math.nan}, "start_s=nan: it must be a number, 0 to 9.22337e+09"),
        ({"end_s": math.inf}, "end_s=inf"),
        ({"end_s": 1e300}, "end_s=1e+300"),
        ({"start_s": -1.0}, "start_s=-1.0"),
        ({"start_s": 2.0, "end_s": 1.0}, "start_s=2: it lies after end_s=1"),
        ({"every_s": -1.0}, "every_s=-1.0"),
        ({"min_change_m2": "much"}, "min_change_m2='much': it must be a number"),
        ({"max_snapshots": 0}, "max_snapshots=0: it must be a whole number, 1 or more"),
        ({"max_snapshots": 2.5}, "max_snapshots=2.5: it must be a whole number"),
        ({"workers": 0}, "workers=0: it must be a whole number, 1 to 1024"),
        ({"workers": 10**6}, "workers=1000000: it must be a whole number, 1 to 1024"),
        ({"workers": None}, "workers=None"),
        ({"workers": True}, "workers=True"),
        ({"method": "magic"}, "method='magic': it must be one of rose2, morphological"),
        ({"layers": ("walls",)}, "layers='walls': there is no such layer"),
        ({"layers": 5}, "layers=5: they must be a text or a sequence of names"),
        ({"layers": [5]}, "layers=[5]"),
        ({"layers": None}, "layers=None"),
        ({"bag": True, "annotated_log": False}, "annotated_log=False leaves out"),
    ],
)
def test_a_value_that_cannot_be_used_is_refused_by_name(wrong: dict[str, object], told: str):
    with pytest.raises(ParameterError) as refused:
        RunOptions(**wrong)
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "wrong",
    [
        {"workers": 0},
        {"workers": 1025},
        {"retries": -1},
        {"scheduler": "head:8786", "workers": 2},
        {"retries": 0.5},
    ],
)
def test_so_is_one_of_a_batch(wrong: dict[str, object]):
    with pytest.raises(ParameterError, match=min(wrong) if len(wrong) == 1 else "workers=2 is for this"):
        BatchOptions(**wrong)


def test_everything_has_a_default():
    assert RunOptions() == RunOptions(topic=None, start_s=None, layers=RECORDING_LAYERS)
    assert BatchOptions().run == RunOptions()


def test_every_option_is_explained():
    for kind in (RunOptions, BatchOptions):
        for about in options_of(kind).values():
            assert about.help[0].isupper()
            assert about.help.endswith(".")


def test_what_is_found_depends_on_the_maps_the_method_and_its_parameters():
    """Not on what is written, nor on how many processes work."""
    which = {"topic", "message_type", "part", "map_from", "map_frame", "start_s", "end_s", "every_s"}
    names = which | {"min_change_m2", "max_snapshots", "method", "parameters"}
    assert set(RunOptions().deciding()) == names
    assert dataclasses.replace(RunOptions(), workers=3, recording=False).deciding() == RunOptions().deciding()


def test_layers_are_named_in_a_text():
    assert layers_named("all") == RECORDING_LAYERS
    assert layers_named("none") == ()
    assert layers_named("lines, predicted") == ("predicted", "lines")
    assert RunOptions(layers="none").layers == RunOptions(layers=()).layers == ()
    assert RunOptions(layers=["lines", "path"]).layers == ("path", "lines")


def test_options_stand_in_the_docstring():
    """In `help(RunOptions)`, as on the command line."""
    for kind in (RunOptions, BatchOptions):
        assert all(about.help in str(kind.__doc__) for about in options_of(kind).values())


def test_the_methods_are_those_that_there_are():
    assert set(METHODS) == {"rose2", *BASELINES}

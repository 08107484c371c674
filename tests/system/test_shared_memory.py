"""Values come out as they went in, and nothing is left behind."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from drawn_maps import office, snapshot

from rose2_logs.config.parameters import Parameters
from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.system.shared_memory import (
    ALIGNMENT_BYTES,
    LARGE_BYTES,
    SharedMemoryError,
    pack,
    shared_memory_folders,
    unpack,
)


def test_an_analysis_comes_out_as_it_went_in(tmp_path: Path):
    """Its large arrays through the file, which is gone once it is opened; all else in the pickle."""
    cells, _ = office(turn_rad=0.3, clutter=5, resolution_m=0.03)
    made = analyze(snapshot(cells, 0.03), Parameters())
    packed = pack(made, [str(tmp_path)])
    assert made.structure is not None
    assert len(packed.pickled) < made.rooms.labels.nbytes / 4
    assert len(packed.spans) >= 2
    found: SnapshotAnalysis = unpack(packed)
    assert not list(tmp_path.iterdir())
    assert found.structure is not None
    for one, other in (
        (made.rooms.labels, found.rooms.labels),
        (made.structure.scores.values, found.structure.scores.values),
        (made.structure.clean_cells.values, found.structure.clean_cells.values),
    ):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
        if one.nbytes >= LARGE_BYTES:
            assert other.ctypes.data % ALIGNMENT_BYTES == 0
    assert [shape.wkb for shape in made.rooms.polygons] == [shape.wkb for shape in found.rooms.polygons]
    assert not found.rooms.labels.flags.writeable


@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_of_any_order_and_kind(tmp_path: Path, order):
    """Large and small, empty, of structured type, not contiguous, the same one twice."""
    large = np.asarray(np.arange(LARGE_BYTES).reshape(256, -1), dtype="f4", order=order)
    kinds = np.zeros(LARGE_BYTES, [("a", "i1"), ("b", "f8")])
    value = {
        "large": large,
        "again": large,
        "part": large[::2, ::3],
        "small": np.arange(3),
        "empty": np.zeros(0),
    }
    found = unpack(pack(value | {"kinds": kinds}, [str(tmp_path)]))
    for name, array in value.items():
        assert found[name].dtype == array.dtype
        np.testing.assert_array_equal(found[name], array)
    assert found["kinds"].dtype == kinds.dtype
    found["large"][:] = 0  # of its own


def test_without_large_arrays_there_is_no_file(tmp_path: Path):
    packed = pack([1, "two", np.arange(3)], [str(tmp_path / "nowhere")])
    assert packed.file is None
    assert unpack(packed)[1] == "two"


def test_the_next_folder_is_taken_where_the_first_has_no_room(tmp_path: Path):
    value = np.zeros(LARGE_BYTES, np.int8)
    packed = pack(value, [str(tmp_path / "nowhere"), str(tmp_path)])
    assert Path(str(packed.file)).parent == tmp_path
    np.testing.assert_array_equal(unpack(packed), value)
    with pytest.raises(SharedMemoryError, match=r"not enough space for 0 MB in .*nowhere"):
        pack(value, [str(tmp_path / "nowhere")])


def test_where_no_folder_has_room_it_says_so_and_leaves_nothing(tmp_path: Path):
    """With the greatest size of a file set low, as on a full disk."""
    script = f"""
import resource, numpy as np
from rose2_logs.system.shared_memory import pack, SharedMemoryError
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
try:
    pack(np.ones(1_000_000), [{str(tmp_path)!r}])
except SharedMemoryError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "not enough space for 8 MB" in done.stdout
    assert not list(tmp_path.iterdir())


def test_what_was_not_taken_out_goes_with_the_folders():
    with shared_memory_folders() as folders:
        pack(np.zeros(LARGE_BYTES, np.int8), folders)
        assert list(Path(folders[0]).iterdir())
    assert not any(Path(folder).exists() for folder in folders)

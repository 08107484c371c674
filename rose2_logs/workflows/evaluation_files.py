"""What an evaluation is going to write: no file twice, none of its inputs, and none that exists unasked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from rose2_logs.drawing.evaluation_pictures import along_file, files_of_pictures
from rose2_logs.errors import OutputError
from rose2_logs.evaluation.cases import Case, load_cases
from rose2_logs.system.files import refuse_existing, writing


def check_files(
    listed: Path,
    chosen: Sequence[Case],
    *,
    predictions: Path | None,
    pictures: Path | None,
    json_file: Path | None,
    along: bool,
    overwrite: bool,
) -> None:
    """Check where an evaluation would write, before it begins.

    Parameters
    ----------
    listed : path
        The list of cases.
    chosen : sequence of Case
        Those that are evaluated; the files of all others on the list are inputs, too.
    predictions, pictures, json_file, along, overwrite
        As for `evaluate_method`.

    Raises
    ------
    CasesError
        If the name of a case leads out of its folder.
    OutputError
        If a file would be written twice, is an input, or exists and may not be replaced.
    """
    outputs: list[Path] = []
    if predictions is not None:
        outputs += [case.image_in(predictions) for case in chosen]
    if pictures is not None:
        outputs += files_of_pictures(pictures, chosen)
        if along:
            outputs += [along_file(pictures, group) for group in dict.fromkeys(each.group for each in chosen)]
    if json_file is not None:
        outputs.append(json_file)
    if not outputs:
        return
    inputs: set[object] = set()
    for image in (listed, *_images(load_cases(listed))):
        with suppress(OSError, ValueError):  # what is wrong with it is told of where it is read
            inputs.add(_place(image))
    taken: set[object] = set()
    for file in outputs:
        with writing(file):
            place = _place(file)
        if place in inputs:
            raise OutputError(f"{file}: the evaluation reads this file; write its results to another place")
        if place in taken:
            raise OutputError(
                f"{file}: two results would be this file; give label images, pictures and figures each a "
                "place of its own, and the cases of a group names of their own"
            )
        taken.add(place)
    refuse_existing(outputs, overwrite=overwrite)


def _images(cases: Iterable[Case]) -> list[Path]:
    images = [image for case in cases for image in (case.map_path, case.rooms_path, case.rooms_other_path)]
    return [image for image in images if image is not None]


def _place(path: Path) -> object:
    """Return what is the same for all names of a file, through links too."""
    try:
        found = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return path.resolve()
    return found.st_dev, found.st_ino

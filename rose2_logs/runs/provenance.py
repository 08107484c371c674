"""Where results come from: versions of the software, fingerprint of the input."""

from __future__ import annotations

import glob
import hashlib
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rose2_logs import __version__
from rose2_logs.errors import LogError
from rose2_logs.io.discovery import MAP_ENDINGS, load_yaml
from rose2_logs.system.files import readable

PACKAGES = (
    "numpy",
    "opencv-python-headless",
    "scipy",
    "scikit-image",
    "scikit-learn",
    "shapely",
    "rosbags",
    "mcap",
    "pyarrow",
    "rerun-sdk",
)
"""Packages that results or their formats depend on."""


def software_versions() -> dict[str, str]:
    """Versions of the tool, of Python and of the packages that results depend on."""
    versions = {"rose2-logs": __version__, "python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed"
    return versions


def log_files(path: Path) -> tuple[Path, ...]:
    """List the files of a log, sorted: itself, or all in its folder, or all that match a pattern.

    The image that a map's ``.yaml`` names counts as its part.
    """
    if path.is_dir():
        return tuple(sorted(file for file in path.rglob("*") if file.is_file()))
    files = [path] if path.exists() else sorted(Path(match) for match in glob.glob(str(path)))  # noqa: PTH207
    return tuple(part for file in files for part in (file, *_image_of(file)))


def _image_of(file: Path) -> tuple[Path, ...]:
    if file.suffix.lower() not in MAP_ENDINGS:
        return ()
    try:
        image = load_yaml(file).get("image")
    except LogError:
        return ()
    found = [file.parent / image] if isinstance(image, str) else []
    return tuple(each for each in found if each.is_file())


def fingerprint(path: Path) -> dict[str, Any]:
    """Size and SHA-256 of a log.

    Returns
    -------
    dict
        ``size_bytes``, ``sha256`` and ``files``, each of these with ``name``, ``size_bytes``, ``sha256``. The
        sum of several files is that of the lines that ``sha256sum`` prints for them, by name.

    Raises
    ------
    LogError
        If a file cannot be read.
    """
    base = path if path.is_dir() else path.parent
    files = []
    for file in log_files(path):
        try:
            with file.open("rb") as stream:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
        except OSError as error:
            raise LogError(f"{file}: cannot be read: {error.strerror}") from error
        name = readable(file.relative_to(base).as_posix() if file.is_relative_to(base) else file)
        files.append({"name": name, "size_bytes": file.stat().st_size, "sha256": digest})
    files.sort(key=lambda entry: str(entry["name"]))
    listing = "".join(f"{entry['sha256']}  {entry['name']}\n" for entry in files)
    whole = files[0]["sha256"] if len(files) == 1 else hashlib.sha256(listing.encode()).hexdigest()
    size = sum(int(str(entry["size_bytes"])) for entry in files)
    return {"size_bytes": size, "sha256": whole, "files": files}

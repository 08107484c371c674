"""YAML files that describe maps and bags, read with bounds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rose2_logs.errors import InvalidMapError, LogError

LARGEST_BYTES = 1 << 22
"""Descriptions are some kilobytes; those of bags with thousands of files a megabyte."""


def load_yaml(path: Path) -> dict[str, Any]:
    """Read a mapping from a YAML file.

    Raises
    ------
    LogError
        If the file cannot be read or is too large.
    InvalidMapError
        If it is not YAML, or describes nothing.
    """
    import yaml

    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise LogError(f"{path}: is no description of a map or a bag, it is too large", file=path)
        # In C where there is one: the one in Python takes time with the square of what is nested.
        loader = yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader
        described = yaml.load(path.read_text(encoding="utf-8"), loader)  # noqa: S506 (both are safe)
    except (OSError, UnicodeDecodeError) as error:
        raise LogError(f"{path}: cannot be read: {error}", file=path) from error
    # Nesting without end, and numbers and dates that Python does not take.
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InvalidMapError(f"{path}: is not YAML: {' '.join(str(error).split())}", file=path) from error
    if not isinstance(described, dict):
        raise InvalidMapError(
            f"{path}: does not describe a map; it needs image, resolution and origin", file=path
        )
    return described

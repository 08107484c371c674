"""The versions that pyproject.toml allows are those that CI tests, at both ends."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).parents[1]
PINS = ROOT / ".ci"
CONFIGURATION = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = CONFIGURATION["project"]
EXTRAS = {
    name: [Requirement(line) for line in lines] for name, lines in PROJECT["optional-dependencies"].items()
}
DIRECT = [Requirement(line) for line in PROJECT["dependencies"]]
NOT_INSTALLED = "train"
"""PyTorch is larger than all else together; only who fits anew needs it."""
OPTIONAL = [each for name, extra in EXTRAS.items() if name != NOT_INSTALLED for each in extra]
BUILD = [Requirement(line) for line in CONFIGURATION["build-system"]["requires"]]

if not PINS.is_dir():
    pytest.skip("the pinned versions are in the repository only", allow_module_level=True)


def bounded(requirements: list[Requirement]) -> list[Requirement]:
    """Leave out the project itself, and further extras of what stands in the list without them."""
    return [each for each in requirements if each.name != PROJECT["name"] and each.specifier]


EVERYTHING = bounded([*DIRECT, *BUILD, *OPTIONAL])
WITH_LOWEST = bounded([*DIRECT, *BUILD, *EXTRAS["batch"], *EXTRAS["dxf"], *EXTRAS["test"], *EXTRAS["docs"]])


def pins(name: str) -> dict[str, list[Version]]:
    """Versions by package; there are several where they depend on Python's."""
    found: dict[str, list[Version]] = {}
    for line in (PINS / name).read_text(encoding="utf-8").splitlines():
        if line and not line.lstrip().startswith("#"):
            package, _, version = line.partition(";")[0].strip().partition("==")
            found.setdefault(package, []).append(Version(version))
    return found


def bound(requirement: Requirement, operator: str) -> Version:
    """Return the one bound of a kind that a requirement must have."""
    (found,) = [Version(each.version) for each in requirement.specifier if each.operator == operator]
    return found


def following(version: Version) -> Iterator[Version]:
    """Versions that may break what used one: the next major, and before 1.0 the next minor."""
    yield Version(f"{version.major + 1}")
    if version.major == 0:
        yield Version(f"0.{version.minor + 1}")


def test_all_that_is_needed_is_looked_at():
    """A requirement without a version is one of the project or adds an extra to another that has one."""
    names = {each.name for each in EVERYTHING} | {PROJECT["name"]}
    assert {each.name for each in [*DIRECT, *BUILD, *OPTIONAL]} <= names


def test_the_upper_bound_is_the_first_version_that_may_break_what_is_tested():
    """The newest version that is allowed is pinned for CI, and nothing beyond its major is let in."""
    tested = pins("constraints.txt")
    assert [each.name for each in EVERYTHING if each.name not in tested] == [], "run .ci/pin"
    wrong = [
        str(each)
        for each in EVERYTHING
        if not all(each.specifier.contains(version) for version in tested[each.name])
        or bound(each, "<") not in set(following(max(tested[each.name])))
    ]
    assert wrong == []


def test_the_lower_bound_is_what_is_tested():
    tested = pins("lowest.txt")
    assert [str(each) for each in WITH_LOWEST if tested.get(each.name) != [bound(each, ">=")]] == []


def test_all_versions_of_python_that_are_named_are_allowed():
    """The oldest is that of lowest.txt."""
    oldest = PROJECT["requires-python"]
    named = [
        Version(text.rpartition(" ")[2])
        for text in PROJECT["classifiers"]
        if text.startswith("Programming Language :: Python :: 3.")
    ]
    assert oldest == f">={min(named)}"
    assert f"--python-version {min(named)} " in (PINS / "pin").read_text(encoding="utf-8")
    assert (PINS / f"on_python_{max(named)}").is_file()

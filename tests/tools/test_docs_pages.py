"""The documentation: pages written from the code tell all of it, pictures and links are there."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import yaml
from docs_pages import PAGES, TABLES, commands_page, parameters_page, tables_page

from rose2_logs.cli.main import commands
from rose2_logs.config.parameters import Parameters, describe_parameters, load_parameters

PROJECT = Path(__file__).parents[2]
DOCS = PROJECT / "docs"
PAGE_FILES = sorted(DOCS.rglob("*.md"))
PICTURES_MAX_BYTES = 2_000_000
ENDINGS = ("json", "parquet", "png", "rrd", "html")
"""Of files that are called like a block of parameters."""


def nav_pages(entries) -> list[str]:
    found = []
    for entry in entries:
        for value in entry.values():
            found += nav_pages(value) if isinstance(value, list) else [value]
    return found


def test_every_parameter_is_told_with_its_default_and_its_reason():
    """The page has a heading for each block and a row for each parameter, which can be set as it stands."""
    blocks = re.split(r"^## ", parameters_page(), flags=re.MULTILINE)[1:]
    told = {block.split("\n")[0]: block for block in blocks}
    for row in describe_parameters():
        (line,) = (line for line in told[row["block"]].splitlines() if f"| `{row['name']}` |" in line)
        assert row["why"].split("*")[0] in line
        default = re.findall(r"`([^`]*)`", line)[1]
        value = f'"{default}"' if isinstance(row["default"], str) else default
        parameters = load_parameters(None, [f"{row['block']}.{row['name']}={value}"])
        found = getattr(getattr(parameters, row["block"]), row["name"])
        assert found == (
            row["default"] if isinstance(found, str) else pytest.approx(row["default"], rel=1e-5)
        )
    assert set(told) == set(Parameters().resolved())


def test_every_column_is_told_with_its_meaning():
    """All tables that are written, in the order of their columns."""
    page = tables_page()
    for name, (schema, _) in TABLES.items():
        part = page.split(f"## {name}")[1].split("\n## ")[0]
        assert re.findall(r"^\| `(\w+)` \|", part, re.MULTILINE) == schema.names


def test_every_command_and_option_is_told():
    """As the command line knows them; no markup of the terminal is left."""
    page = commands_page()
    parts = {part.split("\n")[0]: part for part in page.split("\n## ")[1:]}
    assert list(parts) == list(commands())
    for name, command in commands().items():
        assert command.help.strip().splitlines()[0] in parts[name]
        for param in command.params:
            for option in (
                param.opts if param.opts[0].startswith("-") else [param.metavar or param.name.upper()]
            ):
                assert f"`{option}`" in parts[name]
    assert "[bold]" not in page


def test_the_navigation_names_every_page():
    """Those in the folder and those written from the code."""
    text = (PROJECT / "mkdocs.yml").read_text(encoding="utf-8")
    listed = nav_pages(yaml.safe_load(text)["nav"])
    assert sorted(listed) == sorted([path.relative_to(DOCS).as_posix() for path in PAGE_FILES] + list(PAGES))


def test_links_and_pictures_are_there():
    """Each points to a file, or to a page that is written from the code."""
    missing = [
        f"{page.relative_to(DOCS)}: {link}"
        for page in PAGE_FILES
        for link in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8"))
        if "://" not in link
        and not (target := (page.parent / link).resolve()).is_file()
        and target.relative_to(DOCS).as_posix() not in PAGES
    ]
    assert missing == []


def test_settings_in_the_pages_can_be_copied():
    """Every --set of an example names a parameter and a value that it takes."""
    resolved = Parameters().resolved()
    for page in PAGE_FILES:
        text = page.read_text(encoding="utf-8")
        for setting in re.findall(r"--set '?([a-z_0-9]+\.[a-z_0-9]+=[^\s'`]+)", text):
            if not setting.endswith("..."):
                load_parameters(None, [setting])
        for name in re.findall(r"`([a-z_0-9]+\.[a-z_0-9]+)`", text):
            block, _, parameter = name.partition(".")
            if block in resolved and parameter not in ENDINGS:
                assert parameter in resolved[block], f"{page.relative_to(DOCS)}: {name}"


def test_every_picture_is_shown_and_all_are_small():
    """None lies there unused."""
    pictures = sorted((DOCS / "images").iterdir())
    shown = "".join(page.read_text(encoding="utf-8") for page in PAGE_FILES)
    assert all(f"images/{picture.name}" in shown for picture in pictures)
    assert sum(picture.stat().st_size for picture in pictures) < PICTURES_MAX_BYTES


def test_the_method_is_drawn_stage_by_stage():
    """Ten pictures that differ from each other, each with something on it."""
    from make_docs_pictures import METHOD_LOG, method_pictures

    from rose2_logs.io import open_log

    with open_log(METHOD_LOG) as reader:
        pictures = dict(method_pictures(reader.last(), Parameters()))
    shown = {path.stem for path in (DOCS / "images").glob("method_*.png")}
    assert set(pictures) == shown
    assert all(picture.std() > 5 for picture in pictures.values())
    assert len({picture.tobytes() for picture in pictures.values()}) == len(pictures)
    maps = [picture.shape for name, picture in pictures.items() if "spectrum" not in name]
    assert np.ptp(maps, axis=0).max() == 0


@pytest.mark.skipif(
    None in (find_spec("material"), find_spec("mkdocstrings")), reason="pip install '.[docs]' brings MkDocs"
)
def test_the_site_is_built_without_a_warning(tmp_path: Path):
    """And no page fetches anything from elsewhere."""
    command = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "--strict",
        "--quiet",
        "--site-dir",
        tmp_path / "site",
    ]
    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site" / "reference" / "parameters.html").is_file()
    for page in (tmp_path / "site").rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|link|img|iframe)[^>]+(?:src|href)="(?:https?:)?//', text), page

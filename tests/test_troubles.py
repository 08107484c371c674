"""The page of troubles begins with what the program says."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from rose2_logs.runs.summary import SUMMARY

PROJECT = Path(__file__).parents[1]
PAGE = (PROJECT / "docs" / "troubles.md").read_text(encoding="utf-8")
OTHERS_SAY = {"Unable to locate credentials", "Install s3fs"}
"""Of libraries, which the program passes on."""


def texts_of(file: Path) -> list[str]:
    """Texts in a module, with an ellipsis for what is filled in; neither comments nor its documentation."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    texts = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            node.value = ast.Constant(None)
        elif isinstance(node, ast.JoinedStr):
            texts.append("".join(_text(each) for each in node.values))
        elif isinstance(node, ast.Constant) and isinstance(node.value, (str, bytes)):
            texts.append(_text(node))
    return texts


def _text(node: ast.expr) -> str:
    if not isinstance(node, ast.Constant):
        return "..."
    return node.value.decode(errors="replace") if isinstance(node.value, bytes) else str(node.value)


def test_each_message_on_the_page_is_one_of_the_program():
    said = [text for file in (PROJECT / "rose2_logs").rglob("*.py") for text in texts_of(file)]
    rows = re.findall(r"^\| (`.*?) \|", PAGE, re.MULTILINE)
    named = {text for row in rows for text in re.findall("`([^`]+)`", row)}
    assert len(named) > 40
    filled_in = {text: text.replace(SUMMARY, "...") for text in named}
    assert {text for text in named if not any(filled_in[text] in each for each in said)} == OTHERS_SAY

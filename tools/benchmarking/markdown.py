"""Tables and numbers as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from rose2_logs.evaluation.scores import Scores

MINUS = "\N{MINUS SIGN}"
NOT_KNOWN = ""


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table: the first column to the left, all others to the right."""
    return [
        _row(headings),
        _row(["---", *["---:"] * (len(headings) - 1)]),
        *(_row(row) for row in rows),
        "",
    ]


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def percent(value: float | None) -> str:
    """One decimal; nothing where the value is not known."""
    return NOT_KNOWN if value is None else f"{value:.1f}"


def difference(value: float) -> str:
    """One decimal with its sign; 0.0 without one."""
    text = f"{abs(value):.1f}"
    if text == "0.0":
        return text
    return ("+" if value > 0 else MINUS) + text


def figures_of(values: Scores | Mapping[str, float], names: Sequence[str]) -> list[str]:
    """Figures by name, nothing for those that are not known."""
    if isinstance(values, Scores):
        return [percent(getattr(values, name)) for name in names]
    return [percent(values.get(name)) for name in names]


def rooms_of(scores: Scores) -> str:
    """Number of rooms found over that of the true ones."""
    return f"{scores.rooms_seg:.3g}/{scores.rooms_gt:.3g}"


def bold(text: str, yes: bool = True) -> str:
    """Bold text, where `yes`."""
    return f"**{text}**" if yes and text else text

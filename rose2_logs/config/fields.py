"""How a parameter is declared: a field with its default, unit, bounds and the reason for its value."""

from __future__ import annotations

import math
from dataclasses import field
from typing import Any


def number(default: float, unit: str, why: str, low: float = 0.0, high: float = math.inf) -> Any:
    """Declare a numeric parameter: its default, unit, the sentence that says where it comes from, bounds."""
    return field(default=default, metadata={"unit": unit, "why": why, "low": low, "high": high})


def choice(default: str, choices: tuple[str, ...], why: str) -> Any:
    """Declare a parameter that takes one of a few names."""
    return field(default=default, metadata={"unit": "name", "why": why, "choices": choices})

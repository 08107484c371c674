"""Axes of charts: their ends and marks are round numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rose2_logs.model.occupancy import FloatArray

TICKS_MAX = 8
ROUND_STEPS = (1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True)
class Axis:
    """The range of an axis; a logarithmic one is above 0."""

    low: float
    high: float
    is_log: bool

    def share(self, values: FloatArray) -> FloatArray:
        """Where values lie, 0 at the low end and 1 at the high one."""
        if self.is_log:
            logarithms: FloatArray = np.log(values / self.low) / np.log(self.high / self.low)
            return logarithms
        return (values - self.low) / (self.high - self.low)

    def ticks(self) -> list[float]:
        """Return the values that are marked, round ones."""
        if self.is_log:
            powers = range(round(np.log10(self.low)), round(np.log10(self.high)) + 1)
            return [10.0**power for power in powers]
        step = round_step(self.low, self.high)
        first, last = np.ceil(self.low / step - 1e-9), np.floor(self.high / step + 1e-9)
        # Adding nothing turns a negative zero into zero.
        return [float(number) * step + 0.0 for number in np.arange(first, last + 1)]


def axis_of(values: FloatArray, is_log: bool) -> Axis:
    """Return an axis that holds all values: its ends are multiples of its step, or powers of ten."""
    low, high = float(values.min()), float(values.max())
    if is_log:
        first, last = np.floor(np.log10(low) + 1e-9), np.ceil(np.log10(high) - 1e-9)
        return Axis(10.0**first, 10.0 ** max(last, first + 1), is_log=True)
    if high <= low:
        low, high = low - 1.0, high + 1.0
    step = round_step(low, high)
    return Axis(float(np.floor(low / step) * step), float(np.ceil(high / step) * step), is_log=False)


def round_step(low: float, high: float) -> float:
    """Return the least round step that gives at most `TICKS_MAX` ticks."""
    exact = (high - low) / TICKS_MAX
    power = 10.0 ** np.floor(np.log10(exact))
    return float(next(step * power for step in ROUND_STEPS if step * power >= exact))

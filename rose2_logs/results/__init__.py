"""Results of ``analyze`` and ``batch`` read back from their folders."""

FIGURE_WIDTH_PX = 1800
"""Width of a figure as PNG: 15 cm, a text's width, at 300 dots an inch."""

"""What a user asks for, from input to written results: one module per command."""

FIGURE_WIDTH_PX = 1800
"""Default width of a figure as PNG: 15 cm, a text's width, at 300 dots per inch."""

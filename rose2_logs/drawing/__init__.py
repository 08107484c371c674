"""Floor plans, maps and curves drawn as SVG and as pixels."""

PRINT_WIDTH_PX = 1800
"""Default width of a drawing as PNG: 15 cm, a text's width, at 300 dots per inch."""

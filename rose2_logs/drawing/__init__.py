"""Floor plans, maps and curves drawn as SVG and as pixels."""

PRINT_WIDTH_PX = 1800
"""Default width of a drawing as PNG: 15 cm, a text's width, at 300 dots per inch."""
WIDEST_PX = 20_000
"""Largest width of a drawing as PNG: a page 1.7 m wide at 300 dots per inch, and gigabytes of memory."""

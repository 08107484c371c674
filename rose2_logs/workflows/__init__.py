"""What a user requests, from input to written results: one module per command."""

from rose2_logs.drawing import PRINT_WIDTH_PX

FIGURE_WIDTH_PX = PRINT_WIDTH_PX
"""Default width of a figure as PNG."""

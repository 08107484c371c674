"""The report of a run: one HTML page that needs nothing else."""

PANELS = 12
"""Small pictures of the layout along the run: three rows of four on a screen."""

"""The annotated MCAP, and the layouts of its viewers."""

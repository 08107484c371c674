"""The annotated MCAP, and layouts for its viewers."""

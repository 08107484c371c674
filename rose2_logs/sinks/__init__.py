"""What becomes of a run: Rerun recording, annotated MCAP, tables."""

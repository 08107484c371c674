"""What `tools/benchmark.py` runs and reports."""

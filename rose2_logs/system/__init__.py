"""Files, processes, shared memory and warnings: what any program needs, nothing about robots."""

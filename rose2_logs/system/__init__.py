"""Files, processes, shared memory and warnings: what any program needs, and no robotics."""

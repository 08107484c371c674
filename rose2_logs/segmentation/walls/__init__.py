"""Stage B: segments, wall clusters, representative lines (paper, section III-B)."""

"""Stage C: edges and weights, faces, rooms (paper, section III-C)."""

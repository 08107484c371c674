"""Stage D: Voronoi graph and splitting of rooms (paper, section III-D)."""

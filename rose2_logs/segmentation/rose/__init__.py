"""Stage A: spectrum, dominant directions, structure score, clean map (paper, section III-A)."""

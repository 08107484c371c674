"""The end of stage D: borders, numbers, shapes and doorways of the rooms (paper, section III-D)."""

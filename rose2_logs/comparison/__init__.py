"""Two final layouts, as of two runs in one building: how one is aligned with the other, and what differs."""

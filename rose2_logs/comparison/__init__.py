"""Two final layouts, as of two runs in one building: how one lies over the other, and what differs."""

"""Log to stream of occupancy snapshots; nothing outside this package knows a file format."""

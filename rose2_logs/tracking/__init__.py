"""Identity of rooms over the snapshots of a run."""

"""A run from its maps to stored data, and stored data back to a run."""

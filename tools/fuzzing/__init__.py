"""Fuzzing of what reads strangers' bytes."""

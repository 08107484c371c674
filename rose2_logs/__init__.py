"""Rooms and structure of buildings from the maps in robot logs: ROSE2 along an exploration run."""

__version__ = "0.1.0"

"""Fits the strength of borders between regions: simulated buildings, network, tree of joins, evaluation."""

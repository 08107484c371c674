"""Simulated buildings with true rooms, as maps that robots make of them; thousands in minutes."""

"""Occupancy maps from laser scans whose poses are known."""

"""Segmentations against ground truth."""

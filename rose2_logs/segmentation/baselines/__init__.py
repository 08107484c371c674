"""The room segmentation methods that the paper compares with."""

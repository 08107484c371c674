"""One map to its rooms: the four stages of ROSE2, and the methods that the paper compares with."""

"""The data model: occupancy grids, rooms, what an analysis found, floor plans."""

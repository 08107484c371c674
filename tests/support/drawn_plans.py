"""Plans of two rooms drawn by hand, one of them half unseen."""

from __future__ import annotations

import numpy as np
import shapely

from rose2_logs.model.occupancy import GridGeometry
from rose2_logs.model.room_plan import PlanMap, PlanRoom, RoomPlan
from rose2_logs.model.rooms import Doorway

RESOLUTION_M = 0.1
LEFT, RIGHT = 3, 120
"""Numbers of the rooms: tracks whose values in a segmented map would be 3 and 22."""


def two_rooms_plan(yaw_rad: float = 0.0, origin_xy_m: tuple[float, float] = (-2.0, 1.0)) -> RoomPlan:
    """Two rooms of 4 x 3 m side by side; of the right one only the left half was seen.

    In the grid frame they reach from (1, 1) to (9, 4), and the door is in the middle of their common wall.
    """
    geometry = GridGeometry(RESOLUTION_M, origin_xy_m, yaw_rad, "map", (50, 100))
    cells = np.full(geometry.shape, -1, np.int8)
    labels = np.zeros(geometry.shape, np.int32)
    cells[10:40, 10:70] = 0
    labels[10:40, 10:50], labels[10:40, 50:70] = LEFT, RIGHT
    cells[9:41, 9] = cells[9, 9:71] = cells[40, 9:71] = 100

    def on_world(shape):
        return shapely.transform(shape, geometry.grid_to_world)

    boxes = {LEFT: shapely.box(1, 1, 5, 4), RIGHT: shapely.box(5, 1, 9, 4)}
    rooms = []
    for number, other in ((LEFT, RIGHT), (RIGHT, LEFT)):
        shape = on_world(boxes[number])
        point = tuple(shapely.get_coordinates(shape.centroid)[0].tolist())
        area_m2 = float((labels == number).sum() * geometry.cell_area_m2)
        rooms.append(PlanRoom(number, shape, area_m2, point, (other,), 0.75, 3.0))
    door = Doorway((LEFT, RIGHT), geometry.grid_to_world(np.array([[5.0, 2.0], [5.0, 3.0]])))
    walls_m = geometry.grid_to_world(np.array([[[1.0, 1.0], [9.0, 1.0]], [[1.0, 1.0], [1.0, 4.0]]]))
    below = PlanMap(geometry, cells, labels)
    return RoomPlan("two <rooms> & a door", "map", tuple(rooms), (door,), walls_m, below)

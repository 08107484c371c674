"""The graph of rooms as JSON, in the node-link format of networkx."""

from __future__ import annotations

from typing import Any

from rose2_logs.model.room_plan import RoomPlan


def plan_graph(plan: RoomPlan) -> dict[str, Any]:
    """Return rooms as nodes and doorways as edges.

    ``networkx.node_link_graph(data, edges="edges")`` turns it into a MultiGraph: there may be several
    doorways between two rooms.

    Returns
    -------
    dict
        Ready for `json.dump`.
    """
    nodes = []
    for room in plan.rooms:
        x, y = (None, None) if room.label_point_m is None else room.label_point_m
        nodes.append(
            {
                "id": room.number,
                "name": room.name,
                "area_m2": room.area_m2,
                "predicted_area_m2": room.predicted_area_m2,
                "wall_support": room.wall_support,
                "frontier_m": room.frontier_m,
                "x_m": x,
                "y_m": y,
            }
        )
    strengths = {border.rooms: border.strength for border in plan.borders}
    edges: list[dict[str, Any]] = []
    doors_between: dict[tuple[int, int], int] = {}
    for door in plan.doorways:
        number = doors_between.get(door.rooms, 0)
        doors_between[door.rooms] = number + 1
        x, y = door.ends_m.mean(0).tolist()
        source, target = door.rooms
        edge = {
            "source": source,
            "target": target,
            "key": number,
            "width_m": door.width_m,
            "strength": strengths.get(door.rooms),
            "x_m": x,
            "y_m": y,
        }
        edges.append(edge)
    about = {"name": plan.title, "frame_id": plan.frame_id}
    return {"directed": False, "multigraph": True, "graph": about, "nodes": nodes, "edges": edges}

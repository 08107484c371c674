"""Maps as Foxglove writes them: the schemas of its grids, made by hand, and messages of them."""

from __future__ import annotations

import math

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2


def foxglove_files():
    """Make the schema files of foxglove.Grid, as it is public."""
    number, text, data, message = 1, 9, 12, 11
    fixed32, enum, repeated = 7, 14, 3
    files = []

    def add(name, fields, imports=(), enums=()):
        file = descriptor_pb2.FileDescriptorProto(
            name=f"foxglove/{name}.proto", package="foxglove", syntax="proto3"
        )
        file.dependency.extend(imports)
        made = file.message_type.add(name=name)
        for k, (field, kind, type_name, label) in enumerate(fields, 1):
            made.field.add(name=field, number=k, type=kind, type_name=type_name, label=label)
        for name_of_enum, values in enums:
            made_enum = made.enum_type.add(name=name_of_enum)
            for k, value in enumerate(values):
                made_enum.value.add(name=value, number=k)
        files.append(file)

    for name, parts in (("Vector2", "xy"), ("Vector3", "xyz"), ("Quaternion", "xyzw")):
        add(name, [(part, number, None, 1) for part in parts])
    add(
        "Pose",
        [("position", message, ".foxglove.Vector3", 1), ("orientation", message, ".foxglove.Quaternion", 1)],
        ["foxglove/Vector3.proto", "foxglove/Quaternion.proto"],
    )
    kinds = ["UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64"]
    add(
        "PackedElementField",
        [
            ("name", text, None, 1),
            ("offset", fixed32, None, 1),
            ("type", enum, ".foxglove.PackedElementField.NumericType", 1),
        ],
        enums=[("NumericType", kinds)],
    )
    add(
        "Grid",
        [
            ("timestamp", message, ".google.protobuf.Timestamp", 1),
            ("frame_id", text, None, 1),
            ("pose", message, ".foxglove.Pose", 1),
            ("column_count", fixed32, None, 1),
            ("cell_size", message, ".foxglove.Vector2", 1),
            ("row_stride", fixed32, None, 1),
            ("cell_stride", fixed32, None, 1),
            ("fields", message, ".foxglove.PackedElementField", repeated),
            ("data", data, None, 1),
        ],
        [
            "google/protobuf/timestamp.proto",
            "foxglove/Pose.proto",
            "foxglove/Vector2.proto",
            "foxglove/PackedElementField.proto",
        ],
    )
    timestamp = descriptor_pb2.FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(timestamp)
    return [timestamp, *files]


# Imports come after what needs them: writers promise no order.
SCHEMA = descriptor_pb2.FileDescriptorSet(file=foxglove_files()[::-1]).SerializeToString()


def foxglove_message(values, kind, *, name="occupancy", padding=0):
    """Pack values (H, W) of one field; a field's kind is a number of NumericType, padding is in bytes."""
    pool = descriptor_pool.DescriptorPool()
    for file in foxglove_files():
        pool.Add(file)
    grid = message_factory.GetMessageClass(pool.FindMessageTypeByName("foxglove.Grid"))()
    grid.timestamp.seconds, grid.timestamp.nanos, grid.frame_id = 12, 34, "odom"
    grid.pose.position.x, grid.pose.position.y = 1.5, -2.5
    grid.pose.orientation.z, grid.pose.orientation.w = math.sin(0.2), math.cos(0.2)
    grid.column_count, grid.cell_size.x, grid.cell_size.y = values.shape[1], 0.1, 0.1
    cell = values.itemsize + padding
    grid.cell_stride, grid.row_stride = cell, values.shape[1] * cell + padding
    grid.fields.add(name=name, offset=padding, type=kind)
    rows = np.zeros((values.shape[0], grid.row_stride), np.uint8)
    for k in range(values.shape[1]):
        at = k * cell + padding
        rows[:, at : at + values.itemsize] = np.ascontiguousarray(values[:, k : k + 1]).view(np.uint8)
    grid.data = rows.tobytes()
    return grid

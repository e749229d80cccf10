#!/usr/bin/env python3
"""A recorded motion (`needlebench export SCENARIO --as mcap`) as a recording of rerun, the cell with it.

    pip install mcap mcap-ros2-support numpy rerun-sdk
    python motion_to_rerun.py motion.mcap motion.rrd
    rerun motion.rrd
"""

from __future__ import annotations

import sys

import numpy as np
import rerun as rr
from mcap_ros2.reader import read_ros2_messages

CUBE, SPHERE, CYLINDER, TRIANGLES = 1, 2, 3, 11


def place(position, orientation) -> rr.Transform3D:
    quaternion = rr.Quaternion(xyzw=[orientation.x, orientation.y, orientation.z, orientation.w])
    return rr.Transform3D(translation=[position.x, position.y, position.z], quaternion=quaternion)


def shape(marker):
    """The archetype of a marker."""
    size = np.array([marker.scale.x, marker.scale.y, marker.scale.z])
    colour = [round(255 * part) for part in (marker.color.r, marker.color.g, marker.color.b, marker.color.a)]
    if marker.type == CUBE:
        return rr.Boxes3D(half_sizes=[size / 2], colors=[colour], fill_mode="solid")
    if marker.type == SPHERE:
        return rr.Ellipsoids3D(half_sizes=[size / 2], colors=[colour], fill_mode="solid")
    if marker.type == CYLINDER:
        return rr.Cylinders3D(lengths=[size[2]], radii=[size[0] / 2], colors=[colour], fill_mode="solid")
    corners = np.array([[point.x, point.y, point.z] for point in marker.points])
    triangles = np.arange(len(corners)).reshape(-1, 3)
    return rr.Mesh3D(vertex_positions=corners, triangle_indices=triangles, albedo_factor=colour)


def convert(mcap: str, rrd: str) -> None:
    rr.init("needlebench", recording_id=mcap)
    rr.save(rrd)
    rr.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    # A frame's entity lies within that of its parent.
    entity = {"world": "world"}
    cell = None
    for message in read_ros2_messages(mcap):
        topic, data = message.channel.topic, message.ros_msg
        rr.set_time("simulated", duration=message.log_time_ns * 1e-9)
        if topic in ("/tf", "/tf_static"):
            for each in data.transforms:
                # Of frames that are fixed to a moving one the parent comes later.
                parent = entity.setdefault(each.header.frame_id, each.header.frame_id)
                entity[each.child_frame_id] = f"{parent}/{each.child_frame_id}"
            if topic == "/tf_static":
                fixed = data.transforms
                continue
            for each in data.transforms:
                rr.log(entity[each.child_frame_id], place(each.transform.translation, each.transform.rotation))
            if cell is not None:
                for each in fixed:
                    entity[each.child_frame_id] = f"{entity[each.header.frame_id]}/{each.child_frame_id}"
                    rr.log(
                        entity[each.child_frame_id],
                        place(each.transform.translation, each.transform.rotation),
                        static=True,
                    )
                for marker in cell.markers:
                    path = f"{entity[marker.header.frame_id]}/solids/{marker.ns}/{marker.id}"
                    rr.log(path, place(marker.pose.position, marker.pose.orientation), shape(marker), static=True)
                cell = None
        elif topic == "/cell":
            cell = data
        elif topic.startswith(("/clearance/", "/contact/")):
            rr.log(topic, rr.Scalars(data.data))
        elif topic in ("/joint_states", "/joint_states_planned"):
            for name, position in zip(data.name, data.position, strict=True):
                rr.log(f"{topic}/{name}", rr.Scalars(position))
        elif topic == "/phase":
            rr.log(topic, rr.TextLog(data.data))
    # Writes what is left, and the end of the file.
    rr.disconnect()


if __name__ == "__main__":
    convert(*sys.argv[1:])

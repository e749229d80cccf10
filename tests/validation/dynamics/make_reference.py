"""Forward kinematics and rigid-body dynamics of the shipped models, by Pinocchio.

Pinocchio reads the URDF files itself and shares no code with needlebench: frames, inertias, the
merging of fixed links, the placing of robot and tool are all checked by the comparison.

    pip install pin==4.1.0 numpy==2.4.6
    python3 make_reference.py

writes `reference.json` beside this file: SI units, poses in the world as position and quaternion
(x, y, z, w), matrices by rows. No rotor inertia. The same versions give the same bytes.
"""

import hashlib
import json
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
ROBOT = "models/ur3/ur3.urdf"
TOOL = "models/needle_guide/offset.urdf"
OTHER_FRAMES = "crates/scenario/tests/scenario/foreign_urdf/arm.urdf"

SEED = 20260101
STATES = 45
GRAVITY_M_S2 = 9.80665
LINKS = [
    "shoulder_link",
    "upper_arm_link",
    "forearm_link",
    "wrist_1_link",
    "wrist_2_link",
    "wrist_3_link",
]
GUIDE_FRAMES = ["guide_exit", "needle_tip"]


@dataclass(frozen=True)
class Case:
    """One assembly: where the robot stands and what it carries."""

    name: str
    robot: str
    tool: str | None = None
    mount_rotation_deg: float = 0.0
    base_position_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    base_rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)


CASES = [
    Case(name="arm", robot=ROBOT),
    Case(name="arm_with_tool", robot=ROBOT, tool=TOOL),
    Case(
        name="tilted_arm_with_turned_tool",
        robot=ROBOT,
        tool=TOOL,
        mount_rotation_deg=37.0,
        base_position_mm=(310.0, -240.0, 820.0),
        base_rpy_deg=(25.0, -40.0, 110.0),
    ),
    Case(
        name="hanging_arm_with_turned_tool",
        robot=ROBOT,
        tool=TOOL,
        mount_rotation_deg=90.0,
        base_position_mm=(-60.0, 330.0, 1560.0),
        base_rpy_deg=(180.0, 0.0, 90.0),
    ),
    Case(
        name="arm_with_tool_on_a_wall",
        robot=ROBOT,
        tool=TOOL,
        base_position_mm=(-60.0, 330.0, 1560.0),
        base_rpy_deg=(-90.0, 0.0, 20.0),
    ),
    Case(name="other_frames", robot=OTHER_FRAMES),
]


def numbers(values: list[float]) -> str:
    """Write numbers as a URDF attribute, without loss."""
    return " ".join(repr(float(value)) for value in values)


def fixed_joint(*, parent: str, child: str, xyz: list[float], rpy: list[float]) -> str:
    """Write a fixed joint; lengths in m, angles in rad."""
    return (
        f'<joint name="{parent}_to_{child}" type="fixed">'
        f'<parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{numbers(xyz)}" rpy="{numbers(rpy)}"/></joint>'
    )


def body_of_robot(text: str) -> str:
    """Take what stands inside <robot>, without needlebench's own element."""
    inside = re.sub(r".*?<robot\b[^>]*>(.*)</robot>.*", r"\1", text, flags=re.DOTALL)
    return re.sub(r"<needle_guide\b[^>]*/>", "", inside)


def urdf_of(case: Case) -> str:
    """Assemble the URDF of a case: robot, tool and the place of the robot in the cell."""
    text = (ROOT / case.robot).read_text()
    if case.tool is None:
        return text
    place = fixed_joint(
        parent="cell",
        child="base_link",
        xyz=[value * 1e-3 for value in case.base_position_mm],
        rpy=[math.radians(value) for value in case.base_rpy_deg],
    )
    attach = fixed_joint(
        parent="tool0",
        child="tool_mount",
        xyz=[0.0] * 3,
        rpy=[0.0, 0.0, math.radians(case.mount_rotation_deg)],
    )
    tool = body_of_robot((ROOT / case.tool).read_text())
    inside = f'<link name="cell"/>{place}{body_of_robot(text)}{attach}{tool}'
    return f'<robot name="{case.name}">{inside}</robot>'


def pose(placement: pin.SE3) -> list[float]:
    """Position and quaternion (x, y, z, w)."""
    quaternion = pin.Quaternion(placement.rotation)
    return [*placement.translation.tolist(), *quaternion.coeffs().tolist()]


def configuration(model: pin.Model, angles: np.ndarray) -> np.ndarray:
    """Write angles as Pinocchio does: a continuous joint is cosine and sine."""
    q = pin.neutral(model)
    for joint, angle in zip(model.joints[1:], angles, strict=True):
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = math.cos(angle), math.sin(angle)
        else:
            q[joint.idx_q] = angle
    return q


def reference(case: Case) -> dict[str, object]:
    """Compute one case at seeded states."""
    model = pin.buildModelFromXML(urdf_of(case))
    if model.nv != len(LINKS):
        raise ValueError(f"{case.name}: {model.nv} degrees of freedom")
    data = model.createData()
    random = np.random.default_rng(SEED)
    # A robot alone stands with `base_link` at the world's origin, whatever its file has above.
    root_from_world = pin.SE3.Identity()
    if case.tool is None:
        root_from_world = model.frames[model.getFrameId("base_link")].placement
    gravity_in_world = np.array([0.0, 0.0, -GRAVITY_M_S2])
    model.gravity.linear = root_from_world.rotation @ gravity_in_world
    frames = ["tool0", *(LINKS if case.tool is None else GUIDE_FRAMES)]
    states = []
    for _ in range(STATES):
        angles = random.uniform(-math.pi, math.pi, 6)
        qd = random.uniform(-3.0, 3.0, 6)
        qdd = random.uniform(-10.0, 10.0, 6)
        q = configuration(model, angles)
        pin.framesForwardKinematics(model, data, q)
        poses = [
            pose(root_from_world.inverse() * data.oMf[model.getFrameId(name)]) for name in frames
        ]
        mass = pin.crba(model, data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        gravity = pin.computeGeneralizedGravity(model, data, q).copy()
        torque = pin.rnea(model, data, q, qd, qdd).copy()
        state = {
            "q": angles.tolist(),
            "qd": qd.tolist(),
            "qdd": qdd.tolist(),
            "poses": poses,
            "mass_upper": mass[np.triu_indices(6)].tolist(),
            "gravity_nm": gravity.tolist(),
            "torque_nm": torque.tolist(),
        }
        if case.tool is None:
            tool0 = model.getFrameId("tool0")
            jacobian = pin.computeFrameJacobian(
                model, data, q, tool0, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            turned = np.kron(np.eye(2), root_from_world.rotation.T) @ jacobian
            state["jacobian"] = turned.ravel().tolist()
        states.append(state)
    return {
        "name": case.name,
        "robot": case.robot,
        "tool": case.tool,
        "mount_rotation_deg": case.mount_rotation_deg,
        "base_position_mm": case.base_position_mm,
        "base_rpy_deg": case.base_rpy_deg,
        "frames": frames,
        "states": states,
    }


def main() -> None:
    """Write `reference.json`."""
    files = {
        name: hashlib.sha256((ROOT / name).read_bytes()).hexdigest()
        for name in (ROBOT, TOOL, OTHER_FRAMES)
    }
    document = {
        "made_by": {
            "pinocchio": pin.__version__,
            "numpy": np.__version__,
            "script": "make_reference.py",
        },
        "seed": SEED,
        "gravity_m_s2": GRAVITY_M_S2,
        "sha256": files,
        "cases": [reference(case) for case in CASES],
    }
    path = HERE / "reference.json"
    path.write_text(json.dumps(document, separators=(",", ":")) + "\n")
    print(f"{path}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()

"""Arrays of kinematics against the command line, bit for bit, and against DH matrices written out here."""

from __future__ import annotations

import sys
import threading
import time

import numpy as np
import numpy.typing as npt
import pytest
from conftest import CommandLine

import needlebench as nb

Floats = npt.NDArray[np.float64]

UR3_DH = [  # a (m), d (m), alpha (rad): Universal Robots, DH parameters
    (0.0, 0.1519, np.pi / 2),
    (-0.24365, 0.0, 0.0),
    (-0.21325, 0.0, 0.0),
    (0.0, 0.11235, np.pi / 2),
    (0.0, 0.08535, -np.pi / 2),
    (0.0, 0.0819, 0.0),
]


def dh(joints: Floats) -> Floats:
    """Flange in the controller's base frame: (n, 6) to (n, 4, 4)."""
    pose = np.broadcast_to(np.eye(4), (len(joints), 4, 4)).copy()
    for i, (a, d, alpha) in enumerate(UR3_DH):
        c, s = np.cos(joints[:, i]), np.sin(joints[:, i])
        ca, sa = np.cos(alpha), np.sin(alpha)
        link = np.zeros_like(pose)
        link[:, 0] = np.stack([c, -s * ca, s * sa, a * c], axis=-1)
        link[:, 1] = np.stack([s, c * ca, -c * sa, a * s], axis=-1)
        link[:, 2, 1:] = [sa, ca, d]
        link[:, 3, 3] = 1.0
        pose = pose @ link
    return pose


def postures(count: int, seed: int = 1) -> Floats:
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 6))


def poses_of(joints: Floats) -> Floats:
    return np.asarray(nb.fk(joints).flange_in_base)


def test_forward_kinematics_are_those_of_dh_matrices() -> None:
    q = postures(10_000)
    # Twenty times the rounding of products of lengths below 0.5 m.
    assert np.abs(nb.fk(q).flange_in_base.matrix - dh(q)).max() < 2e-15 * 2


@pytest.mark.parametrize("arm", ["UR3", "UR5e", "UR16e"])
def test_forward_kinematics_are_those_of_the_command_line(command_line: CommandLine, arm: str) -> None:
    for q in postures(3):
        listed = ",".join(map(repr, q.tolist()))
        answer = command_line.json("fk", "--arm", arm, f"--joints={listed}")
        found = nb.fk(q, arm)
        frames = {"flange_in_base": found.flange_in_base, "flange_in_base_link": found.flange_in_base_link}
        expected = {name: answer[name] for name in frames} | answer["links"]
        assert list(found.links) == list(answer["links"]) or set(found.links) == set(answer["links"])
        for name, pose in (frames | found.links).items():
            for key in ("position_m", "rotvec_rad", "quat_wxyz"):
                assert getattr(pose, key).tolist() == expected[name][key]


def test_every_posture_of_a_hundred_thousand_poses_makes_its_pose() -> None:
    q = postures(100_000)
    answers = nb.ik(poses_of(q))
    joints, exists = answers.joints, answers.exists
    assert joints.shape == (100_000, 8, 6) and exists.shape == (100_000, 8)
    assert (np.isnan(joints).all(axis=2) == ~exists).all() and not np.isnan(joints[exists]).any()
    wanted = np.repeat(dh(q), exists.sum(axis=1), axis=0)
    missed = np.abs(dh(joints[exists]) - wanted).max(axis=(1, 2))
    touching = answers.touching[exists]
    # The closed form is exact to 4e-15 m and rad. These poses come from quaternions that are rounded.
    assert missed[~touching].max() < 1e-14
    assert missed[touching].max() < 2e-7
    # The posture that made the pose is among them.
    turned = (joints - q[:, None] + np.pi) % (2 * np.pi) - np.pi
    far = np.where(np.isnan(turned), np.inf, np.abs(turned)).max(axis=2)
    assert far.min(axis=1).max() < 1e-6


@pytest.mark.parametrize("form", ["rotation vectors", "matrices"])
def test_postures_are_those_of_the_command_line(form: str) -> None:
    frame = nb.fk(postures(2000, seed=7)).flange_in_base
    vectors = np.concatenate([frame.position_m, frame.rotvec_rad], axis=1)
    answers = nb.ik(vectors if form == "rotation vectors" else frame.matrix)
    for row, (joints, exists) in enumerate(zip(answers.joints, answers.exists, strict=True)):
        if form == "rotation vectors":
            found = nb.solve(vectors[row], arm="UR3")
        else:
            matrix = ",".join(map(repr, frame.matrix[row].ravel().tolist()))
            found = nb.solve(matrix=matrix, arm="UR3")
        assert found.certificate == nb.CERTIFICATES[answers.certificate[row]]
        labels = [label for label, there in zip(nb.CONFIGURATIONS, exists, strict=True) if there]
        assert labels == [each.label for each in found.solutions]
        assert joints[exists].tolist() == [each.joints_rad.tolist() for each in found.solutions]


def test_postures_are_those_of_the_program(command_line: CommandLine) -> None:
    frame = nb.fk(postures(20, seed=3)).flange_in_base
    vectors = np.concatenate([frame.position_m, frame.rotvec_rad], axis=1)
    answers = nb.ik(vectors, "UR3")
    for row, vector in enumerate(vectors):
        listed = ",".join(map(repr, vector.tolist()))
        answer = command_line.json("ik", "--arm", "UR3", f"--pose={listed}", "--tolerance=1e-7")
        expected = [each["joints_rad"] for each in answer["solutions"]]
        assert answers.joints[row][answers.exists[row]].tolist() == expected


def test_joints_are_a_view_of_the_memory_they_were_computed_in() -> None:
    answers = nb.ik(poses_of(postures(1000)))
    joints = answers.joints
    assert joints.strides == (392, 8, 64)
    assert np.shares_memory(joints, answers.joints)
    assert not joints.flags.owndata and not joints.flags.writeable


def test_memory_is_used_again() -> None:
    first, second = poses_of(postures(1000, seed=1)), poses_of(postures(1000, seed=2))
    for looked_at in (False, True):
        answers = nb.ik(first)
        view = answers.joints if looked_at else None
        assert nb.ik(second, out=answers) is answers
        assert np.array_equal(answers.joints, nb.ik(second).joints, equal_nan=True)
        assert view is None or np.shares_memory(view, answers.joints)
    with pytest.raises(nb.InputError, match="space for 1000 poses"):
        nb.ik(first[:10], out=answers)


def test_one_pose_is_answered_without_an_axis_for_many() -> None:
    pose = poses_of(postures(1))[0]
    answers = nb.ik(pose)
    assert answers.joints.shape == (8, 6) and answers.exists.shape == (8,) and answers.certificate == 0
    several = nb.ik(pose[None])
    assert np.array_equal(several.joints[0], answers.joints)
    assert nb.ik(np.empty((0, 7))).joints.shape == (0, 8, 6)


def test_arrays_of_any_kind_are_taken() -> None:
    pose = poses_of(postures(4))
    expected = nb.ik(pose).joints
    for given in (
        pose.tolist(),
        np.asfortranarray(pose),
        np.repeat(pose, 2, axis=0)[::2],
        pose.astype(">f8"),
    ):
        assert np.array_equal(nb.ik(given).joints, expected, equal_nan=True)
    # Of single precision: the same branches, as near as it goes.
    assert np.nanmax(np.abs(nb.ik(pose.astype(np.float32)).joints - expected)) < 1e-3


def test_a_quaternion_that_is_none_says_so() -> None:
    poses = poses_of(postures(2))
    poses[1, 3:] *= 2
    answers = nb.ik(poses)
    assert [nb.CERTIFICATES[each] for each in answers.certificate] == ["complete", "not_a_pose"]
    assert not answers.exists[1].any() and np.isnan(answers.joints[1]).all()


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        ([1.0, 2.0, 3.0], ["poses", "(3,)", "(7,) or (6,) or (4, 4)"]),
        ("nonsense", ["poses", "not an array of numbers"]),
        ([[0.1, 0.2, 300.0, 0.0, 0.0, 0.0]], ["pose 0", "300.0", "metres"]),
        ([0.1, 0.2, 0.3, 0.0, 0.0, 90.0], ["rotation vector is 90.0000 rad", "radians"]),
        ([0.1, 0.2, float("nan"), 0.0, 0.0, 0.0], ["NaN"]),
        (np.diag([1.0, 1.0, -1.0, 1.0]), ["not a rotation"]),
        (np.full((4, 4), 0.5), ["last row"]),
    ],
)
def test_wrong_poses_are_refused(poses: npt.ArrayLike, words: list[str]) -> None:
    with pytest.raises(nb.InputError) as raised:
        nb.ik(poses)
    assert raised.value.status == 2 and raised.value.findings
    for word in words:
        assert word in str(raised.value)


def test_wrong_arms_and_options_are_refused() -> None:
    with pytest.raises(nb.InputError, match="UR4"):
        nb.ik(poses_of(postures(1)), "UR4")
    with pytest.raises(nb.InputError, match="tolerance"):
        nb.ik(poses_of(postures(1)), tolerance=1.0)
    with pytest.raises(nb.InputError, match="NaN"):
        nb.fk([0, 0, 0, 0, 0, float("nan")])
    with pytest.warns(UserWarning, match="90 deg would be"):
        nb.fk([0, 90, 0, 0, 0, 0])


def test_other_threads_run_meanwhile() -> None:
    poses = poses_of(postures(400_000))
    ticks = 0
    stop = threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not stop.is_set():
            ticks += 1
            time.sleep(0.0005)

    # The interpreter gives its lock away by itself only this often.
    before = sys.getswitchinterval()
    sys.setswitchinterval(100.0)
    thread = threading.Thread(target=tick)
    thread.start()
    try:
        started = ticks
        nb.ik(poses)
        during = ticks - started
    finally:
        stop.set()
        sys.setswitchinterval(before)
        thread.join()
    assert during > 3


def test_a_calibrated_arm_is_solved_one_pose_at_a_time() -> None:
    arm = nb.Arm()
    lower, upper = arm.limits_rad
    assert arm.name == "UR3" and lower.shape == upper.shape == (6,) and (lower < upper).all()
    q = postures(1)[0]
    frame = arm.fk(q).flange_in_base
    found = nb.solve(np.concatenate([frame.position_m, frame.rotvec_rad]))
    assert min(np.abs(each.joints_rad - q).max() for each in found.solutions) < 1e-9
    assert all(each.residual_m < 1e-12 for each in found.solutions)

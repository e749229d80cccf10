"""Every posture of a UR3 for a few hundred poses, by Newton's method in 60 digits.

Shares no algebra with a closed form: forward kinematics is the product of six Denavit-Hartenberg
matrices, postures come from many random starts of a damped least-squares method in double
precision, and each is then followed to 50 digits by Newton's method on the same matrices.

    python3 -m venv env
    env/bin/pip install mpmath==1.4.1 numpy==2.4.6
    env/bin/python make_reference.py

writes `reference.json` beside this file; the same versions give the same bytes, in about twelve
minutes. README.md in the folder above says what each field means.
"""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path

import mpmath as mp
import numpy as np

HERE = Path(__file__).resolve().parent
SEED = 20260301
DIGITS = 60
POSES_PER_CELL = 7
STARTS = 320
STEPS = 120

# Universal Robots, DH parameters for calculations of kinematics and dynamics: UR3 (CB3), m.
D = ["0.1519", "0", "0", "0.11235", "0.08535", "0.0819"]
A = ["0", "-0.24365", "-0.21325", "0", "0", "0"]
# Link twists in quarter turns.
TWIST = [1, 0, 0, 1, -1, 0]

SETS = {
    "generic": "",
    "wrist": "w",
    "elbow": "e",
    "shoulder": "s",
    "wrist_elbow": "we",
    "wrist_shoulder": "ws",
    "elbow_shoulder": "es",
    "wrist_elbow_shoulder": "wes",
    "quarter_turns": "q",
}
AWAY_RAD = [0.0, 1e-9, 1e-7, 1e-5, 1e-3]

# A start that ends this near to the pose (m and rad) is followed further.
CANDIDATE = 1e-10
# Solved: 50 digits.
EXACT = mp.mpf(10) ** -50
# A posture that misses by less (m and rad) misses because the pose was rounded.
NEAR_MISS = 1e-12
# Free wrist 3: every member of the family misses by less than this.
FAMILY = 1e-14
# Postures nearer than this, rad, are one near miss or one family.
SAME_RAD = 1e-6
# A least-squares search has ended when its steps are below this, rad.
SETTLED_RAD = 1e-9
# Of the postures in double precision that lie within 1e-3 rad, so many are followed; and so many of
# those that lie along a valley, as at a wrist 3 that is nearly free.
FOLLOWED_PER_BALL = 8
FOLLOWED_PER_VALLEY = 40


@dataclass
class Found:
    """All postures of one pose."""

    branches: list = field(default_factory=list)
    near_misses: list = field(default_factory=list)
    families: list = field(default_factory=list)


def chain_f64(q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rotation, position, joint axes and their origins of a batch of postures (n, 6)."""
    n = len(q)
    rotation = np.broadcast_to(np.eye(3), (n, 3, 3))
    position = np.zeros((n, 3))
    axes, origins = np.empty((n, 6, 3)), np.empty((n, 6, 3))
    for i in range(6):
        axes[:, i], origins[:, i] = rotation[:, :, 2], position
        c, s = np.cos(q[:, i]), np.sin(q[:, i])
        ca, sa = [(1.0, 0.0), (0.0, 1.0), (0.0, -1.0)][TWIST[i]]
        zero = np.zeros(n)
        link = np.stack(
            [c, -s * ca, s * sa, s, c * ca, -c * sa, zero, zero + sa, zero + ca], axis=1
        ).reshape(n, 3, 3)
        offset = np.stack([float(A[i]) * c, float(A[i]) * s, zero + float(D[i])], axis=1)
        position = position + np.einsum("nij,nj->ni", rotation, offset)
        rotation = rotation @ link
    return rotation, position, axes, origins


def residual_f64(rotation, position, target_rotation, target_position):
    """Twelve entries: position, m, and the rotation matrix."""
    n = len(position)
    return np.concatenate(
        [position - target_position, (rotation - target_rotation).reshape(n, 9)], axis=1
    )


def candidates(target_rotation, target_position, random) -> np.ndarray:
    """Postures in double precision, by Levenberg-Marquardt from random starts."""
    q = random.uniform(-math.pi, math.pi, (STARTS, 6))
    damping = np.full(STARTS, 1e-2)
    rotation, position, axes, origins = chain_f64(q)
    error = residual_f64(rotation, position, target_rotation, target_position)
    cost = np.sum(error**2, axis=1)
    for _ in range(STEPS):
        n = len(q)
        jacobian = np.empty((n, 12, 6))
        jacobian[:, :3] = np.cross(axes, position[:, None] - origins).transpose(0, 2, 1)
        # d(R)/dq_i = z_i x R, column by column.
        turned = np.cross(axes[:, :, None, :], rotation.transpose(0, 2, 1)[:, None])
        jacobian[:, 3:] = turned.transpose(0, 3, 2, 1).reshape(n, 9, 6)
        gradient = np.einsum("nij,ni->nj", jacobian, error)
        normal = np.einsum("nij,nik->njk", jacobian, jacobian)
        normal = normal + damping[:, None, None] * np.eye(6)
        trial = q - np.linalg.solve(normal, gradient[..., None])[..., 0]
        trial_chain = chain_f64(trial)
        trial_error = residual_f64(*trial_chain[:2], target_rotation, target_position)
        trial_cost = np.sum(trial_error**2, axis=1)
        better = trial_cost < cost
        q[better], error[better], cost[better] = trial[better], trial_error[better], trial_cost[better]
        for array, new in zip((rotation, position, axes, origins), trial_chain):
            array[better] = new[better]
        damping = np.where(better, damping * 0.2, damping * 4.0).clip(1e-14, 1e3)
    q = q[cost < CANDIDATE**2]
    return q - 2 * math.pi * np.round(q / (2 * math.pi))


def chain_mp(q):
    """Rotation (rows), position, joint axes and origins in high precision."""
    zero, one = mp.mpf(0), mp.mpf(1)
    r = [[one, zero, zero], [zero, one, zero], [zero, zero, one]]
    p = [zero, zero, zero]
    axes, origins = [], []
    for i in range(6):
        axes.append([row[2] for row in r])
        origins.append(list(p))
        s, c = mp.sin(q[i]), mp.cos(q[i])
        a, d = mp.mpf(A[i]), mp.mpf(D[i])
        ca, sa = [(1, 0), (0, 1), (0, -1)][TWIST[i]]
        link = [[c, -s * ca, s * sa], [s, c * ca, -c * sa], [zero, mp.mpf(sa), mp.mpf(ca)]]
        offset = [a * c, a * s, d]
        p = [p[j] + sum(r[j][k] * offset[k] for k in range(3)) for j in range(3)]
        r = [[sum(r[j][k] * link[k][m] for k in range(3)) for m in range(3)] for j in range(3)]
    return r, p, axes, origins


def cross(a, b):
    """Vector product."""
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def pose_error_mp(target, r, p):
    """Error of a posture: position, m, and half the sum of the crossed columns, sin of the angle."""
    target_r, target_p = target
    turn = [mp.mpf(0)] * 3
    for k in range(3):
        column = cross([row[k] for row in r], [row[k] for row in target_r])
        turn = [turn[j] + column[j] / 2 for j in range(3)]
    return [target_p[j] - p[j] for j in range(3)] + turn


def miss_of(target, q):
    """The larger of the position error, m, and the angle, rad; angles are taken as small."""
    r, p, _, _ = chain_mp(q)
    error = pose_error_mp(target, r, p)
    trace = sum(target[0][j][k] * r[j][k] for j in range(3) for k in range(3))
    if trace < 0:
        return mp.mpf(4)
    return max(mp.sqrt(sum(e * e for e in error[:3])), mp.sqrt(sum(e * e for e in error[3:])))


def cost_of(target, q):
    """Squared error of a posture."""
    r, p, _, _ = chain_mp(q)
    return sum(e * e for e in pose_error_mp(target, r, p))


def step_mp(target, q, free, damping):
    """Damped Newton step of the joints in `free`, and the squared error before it."""
    r, p, axes, origins = chain_mp(q)
    error = pose_error_mp(target, r, p)
    jacobian = mp.matrix(6, len(free))
    for column, i in enumerate(free):
        linear = cross(axes[i], [p[j] - origins[i][j] for j in range(3)])
        for j in range(3):
            jacobian[j, column] = linear[j]
            jacobian[j + 3, column] = axes[i][j]
    if damping == 0 and len(free) == 6:
        step = mp.lu_solve(jacobian, mp.matrix(error))
    else:
        normal = jacobian.T * jacobian
        for i in range(len(free)):
            normal[i, i] += damping
        step = mp.lu_solve(normal, jacobian.T * mp.matrix(error))
    return step, sum(e * e for e in error)


def newton(target, q):
    """The posture to which Newton's method with step halving leads, or None."""
    for _ in range(60):
        try:
            step, cost = step_mp(target, q, range(6), mp.mpf(0))
        except ZeroDivisionError:
            return None
        if mp.sqrt(cost) < EXACT:
            return q
        scale = min(mp.mpf(1), 1 / max(abs(x) for x in step))
        while scale > mp.mpf("1e-4"):
            trial = [a + scale * b for a, b in zip(q, step)]
            if cost_of(target, trial) < cost:
                break
            scale /= 2
        else:
            return None
        q = trial
    return None


def least(target, q, free):
    """The least-squares posture near `q`, moving only the joints in `free`, and if it is found."""
    q = [mp.mpf(x) for x in q]
    damping = mp.mpf("1e-12")
    for _ in range(90):
        step, cost = step_mp(target, q, free, damping)
        if max(abs(x) for x in step) < SETTLED_RAD and damping < mp.mpf("1e-10"):
            return q, True
        trial = list(q)
        for column, i in enumerate(free):
            trial[i] += step[column]
        if cost_of(target, trial) < cost:
            q = trial
            damping /= 30
        else:
            damping *= 10
            if damping > 1:
                break
    return q, False


def wrapped(x):
    """Angle in (-pi, pi]."""
    x = x - 2 * mp.pi * mp.nint(x / (2 * mp.pi))
    return x + 2 * mp.pi if x <= -mp.pi else x


def apart(a, b) -> float:
    """Largest joint difference modulo whole turns, rad."""
    return float(max(abs(wrapped(x - y)) for x, y in zip(a, b)))


def families_of(target, starts) -> list:
    """Free wrist 3: q5 is 0 or pi, q1 and q2 + q3 + q4 +- q6 are determined."""
    found = []
    for q in starts:
        flat = abs(wrapped(mp.mpf(float(q[4])))) < 1
        sign = 1 if flat else -1
        q4 = sum(q[1:4]) + sign * q[5]
        if any(
            family["q5_is_pi"] == (not flat)
            and abs(wrapped(family["q1"] - q[0])) < 1e-3
            and abs(wrapped(family["constant"] - q4)) < 1e-3
            for family in found
        ):
            continue
        exact = [mp.mpf(float(x)) for x in q]
        exact[4] = mp.mpf(0) if flat else mp.pi
        exact, _ = least(target, exact, range(4))
        miss = miss_of(target, exact)
        if miss > FAMILY:
            continue
        found.append(
            {
                "q1": wrapped(exact[0]),
                "q5_is_pi": not flat,
                "constant": wrapped(sum(exact[1:4]) + sign * exact[5]),
                "miss": miss,
            }
        )
    return found


def in_family(q, families) -> bool:
    """Whether a posture is a member of a family, within SAME_RAD."""
    for family in families:
        sign = -1 if family["q5_is_pi"] else 1
        q5 = mp.pi if family["q5_is_pi"] else mp.mpf(0)
        constant = sum(q[1:4]) + sign * q[5]
        differences = (q[0] - family["q1"], q[4] - q5, constant - family["constant"])
        if all(abs(wrapped(x)) < SAME_RAD for x in differences):
            return True
    return False


def solve(target, maker, random) -> Found:
    """Every posture of a pose."""
    target_rotation = np.array([[float(x) for x in row] for row in target[0]])
    target_position = np.array([float(x) for x in target[1]])
    starts = candidates(target_rotation, target_position, random)
    starts = np.vstack([starts, np.array([float(x) for x in maker])])
    found = Found()
    flat = np.abs(np.sin(starts[:, 4])) < SAME_RAD
    found.families = families_of(target, starts[flat])
    kept, misses, valley = [], [], 0
    for q in starts:
        q = [mp.mpf(float(x)) for x in q]
        distances = [apart(q, other) for other in kept]
        if any(d < 1e-13 for d in distances) or in_family(q, found.families):
            continue
        if sum(d < 1e-3 for d in distances) >= FOLLOWED_PER_BALL:
            continue
        if abs(mp.sin(q[4])) < SAME_RAD:
            valley += 1
            if valley > FOLLOWED_PER_VALLEY:
                continue
        kept.append(q)
        exact = newton(target, q)
        if exact is None:
            misses.append(q)
        elif all(apart(exact, other) > 1e-30 for other in found.branches):
            if not in_family(exact, found.families):
                found.branches.append(exact)
    for q in misses:
        if any(apart(q, other) < SAME_RAD for other in found.branches):
            continue
        q, settled = least(target, q, range(6))
        miss = miss_of(target, q)
        known = [*found.branches, *(other for other, _ in found.near_misses)]
        if settled and EXACT < miss < NEAR_MISS and all(apart(q, other) > 1e-4 for other in known):
            found.near_misses.append((q, miss))
    order = lambda q: [round(float(wrapped(x)), 9) for x in q]  # noqa: E731
    found.branches.sort(key=order)
    found.near_misses.sort(key=lambda item: order(item[0]))
    return found


def sample(kind: str, random):
    """A posture of a set, in high precision."""
    if kind == "q":
        return [mp.pi / 2 * int(n) for n in random.integers(-1, 3, 6)]
    while True:
        q = [mp.mpf(float(x)) for x in random.uniform(-math.pi, math.pi, 6)]
        if "w" in kind:
            q[4] = mp.pi * int(random.integers(2))
        if "e" in kind:
            q[2] = mp.pi * int(random.integers(2))
        if "s" in kind:
            # Wrist 2's centre in the plane through the shoulder axis: a2 c2 + a3 c23 + d5 s234 = 0.
            forward = mp.mpf(A[1]) * mp.cos(q[1]) + mp.mpf(A[2]) * mp.cos(q[1] + q[2])
            sine = -forward / mp.mpf(D[4])
            if abs(sine) > 1:
                continue
            angle = mp.asin(sine)
            if random.integers(2):
                angle = mp.pi - angle
            q[3] = angle - q[1] - q[2]
        return q


def quaternion_of(r) -> list:
    """Unit quaternion, w x y z, by the largest component."""
    four = [
        1 + r[0][0] + r[1][1] + r[2][2],
        1 + r[0][0] - r[1][1] - r[2][2],
        1 - r[0][0] + r[1][1] - r[2][2],
        1 - r[0][0] - r[1][1] + r[2][2],
    ]
    largest = max(range(4), key=lambda i: four[i])
    skew = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]]
    square = [
        [four[0], *skew],
        [skew[0], four[1], r[0][1] + r[1][0], r[0][2] + r[2][0]],
        [skew[1], r[0][1] + r[1][0], four[2], r[1][2] + r[2][1]],
        [skew[2], r[0][2] + r[2][0], r[1][2] + r[2][1], four[3]],
    ][largest]
    norm = mp.sqrt(sum(x * x for x in square))
    return [x / norm for x in square]


def target_of(pose):
    """Rotation (rows) and position of seven doubles, taken as exact; the quaternion is scaled."""
    w, x, y, z = (mp.mpf(v) for v in pose[3:])
    s = 2 / (w * w + x * x + y * y + z * z)
    rotation = [
        [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
        [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
        [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
    ]
    return rotation, [mp.mpf(v) for v in pose[:3]]


def doubles(q) -> list:
    """Wrapped angles rounded to double precision."""
    return [float(wrapped(x)) for x in q]


def case_of(name: str, away: float, rounded: bool, random) -> dict:
    """One pose of a set with all its postures."""
    maker = sample(SETS[name], random)
    maker = [x + mp.mpf(away) * mp.mpf(float(u)) for x, u in zip(maker, random.uniform(-1, 1, 6))]
    r, p, _, _ = chain_mp(maker)
    pose = [float(x) for x in [*p, *quaternion_of(r)]]
    if rounded:
        single = np.array(pose, dtype=np.float32).astype(np.float64)
        single[3:] /= math.sqrt(float(np.sum(single[3:] ** 2)))
        pose = single.tolist()
    target = target_of(pose)
    found = solve(target, maker, random)
    return {
        "set": name,
        "away_rad": away,
        "rounded_to_f32": rounded,
        "pose": pose,
        "maker": doubles(maker),
        "maker_miss": float(miss_of(target, maker)),
        "branches": [doubles(q) for q in found.branches],
        "near_misses": [{"joints": doubles(q), "miss": float(m)} for q, m in found.near_misses],
        "families": [
            {
                "q1": float(family["q1"]),
                "q5_is_pi": family["q5_is_pi"],
                "constant": float(family["constant"]),
                "miss": float(family["miss"]),
            }
            for family in found.families
        ],
    }


def main() -> None:
    """Write `reference.json`."""
    mp.mp.dps = DIGITS
    cases = []
    for index, name in enumerate(SETS):
        for column, away in enumerate([*AWAY_RAD, None]):
            random = np.random.default_rng([SEED, index, column])
            for _ in range(POSES_PER_CELL):
                cases.append(case_of(name, away or 0.0, away is None, random))
            counts = [
                (len(c["branches"]), len(c["near_misses"]), len(c["families"]))
                for c in cases[-POSES_PER_CELL:]
            ]
            print(name, "f32" if away is None else away, counts, flush=True)
    document = {
        "made_by": {
            "mpmath": mp.__version__,
            "numpy": np.__version__,
            "script": "make_reference.py",
            "digits": DIGITS,
        },
        "seed": SEED,
        "cases": cases,
    }
    text = json.dumps(document, separators=(",", ":")).replace('{"set"', '\n{"set"')
    path = HERE / "reference.json"
    path.write_text(text + "\n")
    print(f"{path}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()

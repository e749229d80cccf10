"""Every posture of a UR3 for a few hundred poses, by path tracking.

Shares no algebra with a closed form: forward kinematics is the product of six Denavit-Hartenberg
matrices, and nothing else about the arm is used. At a generic pose, Newton's method from random
starts finds eight postures. The pose is then moved to the wanted one along a path through complex
joint positions, where no two postures meet, and Newton's method follows all eight. Real ends are
the postures of the wanted pose; a pair of complex ends that is real but for a tiny imaginary part
is a posture that the rounding of the pose makes miss. That the eight ends differ shows that no path
has jumped to another, and eight is the most that a UR arm has.

    python3 -m venv env
    env/bin/pip install gmpy2==2.3.2 numpy==2.4.6
    env/bin/python make_reference.py

writes `reference.json` beside this file. The same versions give the same bytes.
"""

import json
import math
import sys
from dataclasses import dataclass, field
from pathlib import Path

import gmpy2
import numpy as np
from gmpy2 import mpc, mpfr

HERE = Path(__file__).resolve().parent
SEED = 20260301
gmpy2.get_context().precision = 300
POSES_PER_CELL = 8

# Universal Robots, DH parameters for calculations of kinematics and dynamics: UR3 (CB3), m.
D = ["0.1519", "0", "0", "0.11235", "0.08535", "0.0819"]
A = ["0", "-0.24365", "-0.21325", "0", "0", "0"]
# Sines of the link twists; their cosines are 0 where these are not, and 1 elsewhere.
TWIST_SINE = [1, 0, 0, 1, -1, 0]
D_MP, A_MP = [mpfr(x) for x in D], [mpfr(x) for x in A]
PI = gmpy2.const_pi()

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

# Newton's method ends when its step is below this, rad.
EXACT = mpfr("1e-60")
# Each of its steps is at most this share of the one before.
CONTRACTION = mpfr("0.2")
# Share of the first step's limit that the last one along a path keeps to.
ON_THE_PATH = mpfr("1e-3")
# An end of a path is real if its imaginary part is below this, rad.
REAL = mpfr("1e-50")
# Ends with a smaller imaginary part, rad, are looked at as postures that miss.
NEARLY_REAL = 3e-3
# A posture that misses by less (m and rad) misses because the pose was rounded.
NEAR_MISS = 1e-12
# Free wrist 3: every member of the family misses by less than this.
FAMILY = 1e-14
# Postures nearer than this, rad, are one family or members of it.
SAME_RAD = 1e-6
# Where a path ends whose end is not a single posture.
PATH_END = mpfr("1e-40")


@dataclass
class Found:
    """All postures of one pose."""

    branches: list = field(default_factory=list)
    near_misses: list = field(default_factory=list)
    families: list = field(default_factory=list)


# Forward kinematics.


def cs_of(q):
    """Cosines and sines of joint positions, which may be complex."""
    result = []
    for x in q:
        re, im = mpfr(x.real), mpfr(x.imag)
        sin, cos = gmpy2.sin(re), gmpy2.cos(re)
        if im == 0:
            result.append((cos, sin))
        else:
            sinh, cosh = gmpy2.sinh(im), gmpy2.cosh(im)
            result.append((mpc(cos * cosh, -sin * sinh), mpc(sin * cosh, cos * sinh)))
    return result


def chain(cs):
    """Rotation (rows), position, joint axes and their origins."""
    zero, one = mpfr(0), mpfr(1)
    r = [[one, zero, zero], [zero, one, zero], [zero, zero, one]]
    p = [zero, zero, zero]
    axes, origins = [], []
    for i, (c, s) in enumerate(cs):
        x = [c * row[0] + s * row[1] for row in r]
        y = [c * row[1] - s * row[0] for row in r]
        z = [row[2] for row in r]
        axes.append(z)
        origins.append(p)
        a, d, sine = A_MP[i], D_MP[i], TWIST_SINE[i]
        p = [p[j] + a * x[j] + d * z[j] for j in range(3)]
        if sine == 0:
            columns = (x, y, z)
        elif sine == 1:
            columns = (x, z, [-v for v in y])
        else:
            columns = (x, [-v for v in z], y)
        r = [[column[j] for column in columns] for j in range(3)]
    return r, p, axes, origins


def cross(a, b):
    """Vector product."""
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def pose_error(target, r, p):
    """Position error, m, and half the sum of the crossed columns: axis times sine of the angle."""
    target_r, target_p = target
    turn = [mpfr(0)] * 3
    for k in range(3):
        column = cross([row[k] for row in r], [row[k] for row in target_r])
        turn = [turn[j] + column[j] / 2 for j in range(3)]
    return [target_p[j] - p[j] for j in range(3)] + turn


def system(target, cs):
    """Error of a posture and its geometric Jacobian (rows)."""
    r, p, axes, origins = chain(cs)
    columns = [cross(z, [p[j] - o[j] for j in range(3)]) + z for z, o in zip(axes, origins)]
    return pose_error(target, r, p), [[column[j] for column in columns] for j in range(6)]


def solve_linear(rows, right):
    """Gauss elimination with row pivoting; None if singular."""
    n = len(right)
    m = [[*row, value] for row, value in zip(rows, right)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: size(m[i][k]))
        m[k], m[pivot] = m[pivot], m[k]
        if m[k][k] == 0:
            return None
        inverse = 1 / m[k][k]
        for i in range(k + 1, n):
            factor = m[i][k] * inverse
            if factor != 0:
                m[i] = [*m[i][: k + 1], *(m[i][j] - factor * m[k][j] for j in range(k + 1, n + 1))]
    x = [mpfr(0)] * n
    for k in reversed(range(n)):
        x[k] = (m[k][n] - sum(m[k][j] * x[j] for j in range(k + 1, n))) / m[k][k]
    return x


def size(x) -> float:
    """Magnitude, roughly, without a root; exponents beyond double precision do not matter."""
    return max(abs(x.real), abs(x.imag))


def turned(cs, step):
    """Postures (cosines and sines) after a step of the joints, rad."""
    result = []
    for (c, s), delta in zip(cs, cs_of(step)):
        result.append((c * delta[0] - s * delta[1], s * delta[0] + c * delta[1]))
    return result


def wrapped(x):
    """Angle in (-pi, pi]."""
    x = x - 2 * PI * gmpy2.rint(x / (2 * PI))
    return x + 2 * PI if x <= -PI else x


def apart(a, b) -> float:
    """Largest joint difference modulo whole turns, rad."""
    return float(max(abs(wrapped(x - y)) for x, y in zip(a, b)))


def complex_apart(a, b) -> float:
    """Largest difference of two ends, rad."""
    imaginary = max(abs(x - y) for x, y in zip(a[1], b[1]))
    return max(apart(a[0], b[0]), float(imaginary))


def miss_of(target, q):
    """The larger of the position error, m, and the angle, rad; angles are taken as small."""
    r, p, _, _ = chain(cs_of([mpfr(x) for x in q]))
    error = pose_error(target, r, p)
    if sum(target[0][j][k] * r[j][k] for j in range(3) for k in range(3)) < 2:
        return mpfr(4)
    norms = [gmpy2.sqrt(sum(e * e for e in part)) for part in (error[:3], error[3:])]
    return max(norms)


# Path tracking.


def newton(target, cs, *, limit: float, to_the_end: bool):
    """Follow Newton's method; None unless every step is far shorter than the one before.

    `limit`, rad, is for the first step. Along a path a few digits are enough.
    """
    bound = mpfr(limit)
    for _ in range(12):
        error, jacobian = system(target, cs)
        step = solve_linear(jacobian, error)
        if step is None:
            return None
        length = max(size(x) for x in step)
        if length < EXACT:
            return cs
        if length > bound:
            return None
        cs = turned(cs, step)
        if not to_the_end and length < limit * ON_THE_PATH:
            return cs
        bound = length * CONTRACTION
    return None


@dataclass
class Path:
    """Poses from the start's, at tau = 1, to the target's, at tau = 0."""

    start: list
    maker: list
    detour: list
    correction: tuple

    def target(self, tau):
        """Pose at a place on the path, complex but of determinant one."""
        bend = mpc(0, 1) * tau * (1 - tau)
        q = [
            tau * s + (1 - tau) * m + bend * d
            for s, m, d in zip(self.start, self.maker, self.detour)
        ]
        r, p, _, _ = chain(cs_of(q))
        cr, cp = self.correction
        rotation = [[sum(cr[j][k] * r[k][m] for k in range(3)) for m in range(3)] for j in range(3)]
        position = [sum(cr[j][k] * p[k] for k in range(3)) + cp[j] for j in range(3)]
        return rotation, position


def track(path: Path, cs):
    """Follow one posture along a path to its end; tells whether the end is solved for."""
    tau, share = mpfr(1), mpfr("0.05")
    while tau > PATH_END:
        if tau < 0.02:
            end = newton(path.target(mpfr(0)), cs, limit=0.01, to_the_end=True)
            if end is not None:
                return end, True
        # Relative steps: near its end the path may pass close to a singular pose.
        following = tau * (1 - share)
        found = newton(path.target(following), cs, limit=0.15, to_the_end=False)
        if found is None:
            share /= 3
            if share < 1e-9:
                return None, False
            continue
        cs, tau = found, following
        share = min(share * mpfr("1.6"), mpfr("0.9"))
    return cs, False


def angles_of(cs):
    """Joint positions, real and imaginary parts, from cosines and sines."""
    result = []
    for c, s in cs:
        # exp(iq) = c + i s; its size is exp(-Im q).
        unit = mpc(c) + mpc(0, 1) * mpc(s)
        other = mpc(c) - mpc(0, 1) * mpc(s)
        real = gmpy2.phase(unit) if abs(unit) > abs(other) else -gmpy2.phase(other)
        result.append((real, (gmpy2.log(abs(other)) - gmpy2.log(abs(unit))) / 2))
    return result


def start_postures(random):
    """A generic pose with eight postures, all of them, by Newton's method from random starts."""
    while True:
        maker = [mpfr(float(x)) for x in random.uniform(-math.pi, math.pi, 6)]
        r, p, _, _ = chain(cs_of(maker))
        found = []
        for q in candidates((r, p), random, starts=600):
            end = newton((r, p), cs_of([mpfr(float(x)) for x in q]), limit=0.1, to_the_end=True)
            if end is None:
                continue
            q = [real for real, _ in angles_of(end)]
            if all(apart(q, other) > 1e-6 for other in found):
                found.append(q)
        if len(found) == 8:
            return maker, found


# Double precision: starts, and members of families.


def chain_f64(q: np.ndarray) -> list[np.ndarray]:
    """Rotation, position, joint axes and their origins of a batch of postures (n, 6)."""
    n = len(q)
    rotation = np.tile(np.eye(3), (n, 1, 1))
    position = np.zeros((n, 3))
    axes, origins = np.empty((n, 6, 3)), np.empty((n, 6, 3))
    for i in range(6):
        axes[:, i], origins[:, i] = rotation[:, :, 2], position
        c, s = np.cos(q[:, i]), np.sin(q[:, i])
        sa = float(TWIST_SINE[i])
        ca = 1.0 - abs(sa)
        zero = np.zeros(n)
        link = np.stack(
            [c, -s * ca, s * sa, s, c * ca, -c * sa, zero, zero + sa, zero + ca], axis=1
        ).reshape(n, 3, 3)
        offset = np.stack([float(A[i]) * c, float(A[i]) * s, zero + float(D[i])], axis=1)
        position = position + np.einsum("nij,nj->ni", rotation, offset)
        rotation = rotation @ link
    return [rotation, position, axes, origins]


def candidates(target, random, *, starts: int) -> np.ndarray:
    """Postures to 1e-10 m and rad, by Levenberg-Marquardt from random starts."""
    target_rotation = np.array([[float(x) for x in row] for row in target[0]])
    target_position = np.array([float(x) for x in target[1]])

    def residual(at):
        rotations = (at[0] - target_rotation).reshape(-1, 9)
        return np.concatenate([at[1] - target_position, rotations], axis=1)

    q = random.uniform(-math.pi, math.pi, (starts, 6))
    damping = np.full(starts, 1e-2)
    now = chain_f64(q)
    error = residual(now)
    cost = np.sum(error**2, axis=1)
    for _ in range(120):
        rotation, position, axes, origins = now
        jacobian = np.empty((starts, 12, 6))
        jacobian[:, :3] = np.cross(axes, position[:, None] - origins).transpose(0, 2, 1)
        # d(R)/dq_i = z_i x R, column by column.
        turned_columns = np.cross(axes[:, :, None, :], rotation.transpose(0, 2, 1)[:, None])
        jacobian[:, 3:] = turned_columns.transpose(0, 3, 2, 1).reshape(starts, 9, 6)
        gradient = np.einsum("nij,ni->nj", jacobian, error)
        normal = np.einsum("nij,nik->njk", jacobian, jacobian)
        normal += damping[:, None, None] * np.eye(6)
        trial = q - np.linalg.solve(normal, gradient[..., None])[..., 0]
        trial_at = chain_f64(trial)
        trial_error = residual(trial_at)
        trial_cost = np.sum(trial_error**2, axis=1)
        better = trial_cost < cost
        q[better], error[better], cost[better] = (
            trial[better],
            trial_error[better],
            trial_cost[better],
        )
        for array, new in zip(now, trial_at):
            array[better] = new[better]
        damping = np.where(better, damping * 0.2, damping * 4.0).clip(1e-13, 1e3)
    return q[cost < 1e-20]


def improved(target, q, free):
    """Least-squares posture near `q`, by steps of the joints in `free` across steep directions."""
    q = [mpfr(x) for x in q]
    for _ in range(8):
        error, jacobian = system(target, cs_of(q))
        j = np.array([[float(row[i]) for i in free] for row in jacobian])
        scale = max(float(max(abs(e) for e in error)), 1e-300)
        step = np.linalg.lstsq(j, np.array([float(e / scale) for e in error]), rcond=1e-3)[0]
        for i, x in zip(free, step):
            q[i] += mpfr(float(x)) * mpfr(scale)
    return q


def families_of(target, starts) -> list:
    """Free wrist 3: q5 is 0 or pi, q1 and q2 + q3 + q4 +- q6 are determined."""
    found = []
    for q in starts:
        is_pi = math.cos(float(q[4])) < 0
        sign = -1 if is_pi else 1
        q = [mpfr(float(x)) for x in q]
        q[4] = PI if is_pi else mpfr(0)
        if any(
            family["q5_is_pi"] == is_pi and abs(wrapped(family["q1"] - q[0])) < 1e-3
            for family in found
        ):
            continue
        q = improved(target, q, range(4))
        miss = miss_of(target, q)
        if miss < FAMILY:
            constant = wrapped(sum(q[1:4]) + sign * q[5])
            family = {"q1": wrapped(q[0]), "q5_is_pi": is_pi, "constant": constant, "miss": miss}
            found.append(family)
    return found


def in_family(q, families) -> bool:
    """Whether a posture is a member of a family, within SAME_RAD."""
    for family in families:
        sign = -1 if family["q5_is_pi"] else 1
        q5 = PI if family["q5_is_pi"] else mpfr(0)
        constant = sum(q[1:4]) + sign * q[5]
        differences = (q[0] - family["q1"], q[4] - q5, constant - family["constant"])
        if all(abs(wrapped(x)) < SAME_RAD for x in differences):
            return True
    return False


def ends_of(target, maker, start, random):
    """The eight ends of the paths: joint positions, imaginary parts, whether fully converged."""
    start_maker, start_q = start
    r, p, _, _ = chain(cs_of(maker))
    # target = correction * pose of the maker, so that the path ends at the pose as rounded.
    cr = [[sum(target[0][j][k] * r[m][k] for k in range(3)) for m in range(3)] for j in range(3)]
    cp = [target[1][j] - sum(cr[j][k] * p[k] for k in range(3)) for j in range(3)]
    while True:
        detour = [mpfr(float(x)) for x in random.uniform(0.4, 1.2, 6) * random.choice([-1, 1], 6)]
        path = Path(start=start_maker, maker=maker, detour=detour, correction=(cr, cp))
        ends = []
        for q in start_q:
            # The correction moves the start by a rounding.
            cs = newton(path.target(mpfr(1)), cs_of(q), limit=0.01, to_the_end=True)
            if cs is not None:
                cs, converged = track(path, cs)
            if cs is None:
                break
            angles = angles_of(cs)
            ends.append(([x for x, _ in angles], [y for _, y in angles], converged))
        if len(ends) < 8:
            continue
        flat = [end for end in ends if end[2]]
        pairs = [(a, b) for i, a in enumerate(flat) for b in flat[:i]]
        if all(complex_apart(a, b) > 1e-30 for a, b in pairs):
            return ends
        print("a path jumped: another detour", file=sys.stderr)


def solve(target, maker, start, random) -> Found:
    """Every posture of a pose."""
    found = Found()
    ends = ends_of(target, maker, start, random)
    suspects = [q for q, _, _ in ends if abs(gmpy2.sin(q[4])) < SAME_RAD]
    if suspects or abs(gmpy2.sin(maker[4])) < SAME_RAD:
        members = candidates(target, random, starts=200)
        members = members[np.abs(np.sin(members[:, 4])) < SAME_RAD]
        found.families = families_of(target, [maker, *members, *suspects])
    misses = []
    for q, imaginary, converged in ends:
        if in_family(q, found.families):
            continue
        largest = max(abs(x) for x in imaginary)
        if converged and largest < REAL:
            found.branches.append(q)
        elif largest < NEARLY_REAL:
            misses.append(q)
    # Ends that would be one posture but for the rounding: the middle of them.
    groups = []
    for q in misses:
        group = next((g for g in groups if apart(g[0], q) < NEARLY_REAL), None)
        if group is None:
            groups.append([q])
        else:
            group.append(q)
    middles = [
        [g[0][i] + sum(wrapped(q[i] - g[0][i]) for q in g) / len(g) for i in range(6)]
        for g in groups
    ]
    for q in [maker, *(improved(target, q, range(6)) for q in middles)]:
        known = [*found.branches, *(other for other, _ in found.near_misses)]
        miss = miss_of(target, q)
        if miss < NEAR_MISS and not in_family(q, found.families):
            if all(apart(q, other) > 1e-3 for other in known):
                found.near_misses.append((q, miss))
    found.branches.sort(key=doubles)
    return found


# Poses.


def sample(kind: str, random):
    """A posture of a set, in high precision."""
    if kind == "q":
        return [PI / 2 * int(n) for n in random.integers(-1, 3, 6)]
    while True:
        q = [mpfr(float(x)) for x in random.uniform(-math.pi, math.pi, 6)]
        if "w" in kind:
            q[4] = PI * int(random.integers(2))
        if "e" in kind:
            q[2] = PI * int(random.integers(2))
        if "s" in kind:
            # Wrist 2's centre in the plane through the shoulder axis: a2 c2 + a3 c23 + d5 s234 = 0.
            forward = A_MP[1] * gmpy2.cos(q[1]) + A_MP[2] * gmpy2.cos(q[1] + q[2])
            sine = -forward / D_MP[4]
            if abs(sine) > 1:
                continue
            angle = gmpy2.asin(sine)
            if random.integers(2):
                angle = PI - angle
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
    norm = gmpy2.sqrt(sum(x * x for x in square))
    return [x / norm for x in square]


def target_of(pose):
    """Rotation (rows) and position of seven doubles, taken as exact; the quaternion is scaled."""
    w, x, y, z = (mpfr(v) for v in pose[3:])
    s = 2 / (w * w + x * x + y * y + z * z)
    rotation = [
        [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
        [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
        [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
    ]
    return rotation, [mpfr(v) for v in pose[:3]]


def doubles(q) -> list:
    """Wrapped angles rounded to double precision."""
    return [float(wrapped(x)) + 0.0 for x in q]


def case_of(name: str, away: float, rounded: bool, start, random) -> dict:
    """One pose of a set with all its postures."""
    maker = sample(SETS[name], random)
    maker = [x + mpfr(away) * mpfr(float(u)) for x, u in zip(maker, random.uniform(-1, 1, 6))]
    r, p, _, _ = chain(cs_of(maker))
    pose = [float(x) for x in [*p, *quaternion_of(r)]]
    if rounded:
        single = np.array(pose, dtype=np.float32).astype(np.float64)
        single[3:] /= math.sqrt(float(np.sum(single[3:] ** 2)))
        pose = single.tolist()
    target = target_of(pose)
    found = solve(target, maker, start, random)
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
    cases = []
    start = start_postures(np.random.default_rng(SEED))
    for index, name in enumerate(SETS):
        for column, away in enumerate([*AWAY_RAD, None]):
            random = np.random.default_rng([SEED, index, column])
            for _ in range(POSES_PER_CELL):
                cases.append(case_of(name, away or 0.0, away is None, start, random))
            counts = [
                (len(c["branches"]), len(c["near_misses"]), len(c["families"]))
                for c in cases[-POSES_PER_CELL:]
            ]
            print(name, "f32" if away is None else away, counts, flush=True)
    document = {
        "made_by": {
            "gmpy2": gmpy2.version(),
            "mpfr": gmpy2.mpfr_version(),
            "numpy": np.__version__,
            "script": "make_reference.py",
            "bits": gmpy2.get_context().precision,
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

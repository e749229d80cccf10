"""Signed distances of random pairs of convex shapes, by methods that share no code with the product.

Apart: Coal's GJK gives the witness points; where a certificate (support planes against witness
points) is wider than `CERTIFIED_GAP_M`, SLSQP solves the convex programme afresh. What is written
is certified either way. Penetrating: the depth is the least overlap over all directions. For
polytopes that is the nearest facet of the Minkowski difference (Qhull, exact). A cylinder's
Minkowski difference adds normals that form circles (across the axis, across each edge of the
partner) and, for two cylinders, the whole sphere; these are sampled densely and minimised.

Spheres and capsules are points and segments with a radius, which is exact for both signs.
What Coal itself answers is kept beside the reference, so that its error can be reported: with
a sphere or capsule deep in a flat cylinder it takes the side instead of the cap (0.1 m off) and
on some cylinders it gives up.

Run: python3 -m venv env && env/bin/pip install coal==3.0.3 numpy==2.4.6 scipy==1.17.1
     env/bin/python make_reference.py    (about a minute; writes reference.json beside itself)
"""

from __future__ import annotations

import itertools
import json
import sys
from dataclasses import dataclass
from pathlib import Path

import coal
import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

SEED = 20240611
CASES_PER_PAIR = 300
SHAPES_PER_KIND = 10
KINDS = ("sphere", "cylinder", "capsule", "cuboid", "convex")
CERTIFIED_GAP_M = 2e-11
NEAR_TOUCHING_M = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


@dataclass(frozen=True)
class Shape:
    """A convex core about the origin and a radius around it."""

    kind: str
    params: tuple[float, ...]
    points: Array  # vertices of the polytopal part
    normals: Array  # facet normals of the polytopal part
    edges: Array  # edge directions of the polytopal part
    disc_m: float  # radius of a disc across z that is added to the polytopal part
    radius_m: float  # radius of a ball that is added to all of it


def outline(*, points: Array) -> tuple[Array, Array]:
    """Facet normals and edge directions of a solid hull."""
    hull = ConvexHull(points)
    edges = [points[i] - points[j] for s in hull.simplices for i, j in itertools.combinations(s, 2)]
    return np.unique(hull.equations[:, :3], axis=0), unique_directions(vectors=np.array(edges))


def unique_directions(*, vectors: Array) -> Array:
    unit = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    for axis in (2, 1, 0):
        flip = unit[:, axis] < -1e-9
        unit[flip & np.all(np.abs(unit[:, axis + 1 :]) < 1e-9, axis=1)] *= -1.0
    return np.unique(np.round(unit, 12), axis=0)


def make_shape(*, kind: str, params: tuple[float, ...], mesh: Array | None = None) -> Shape:
    none = np.zeros((0, 3))
    z = np.array([[0.0, 0.0, 1.0]])
    if kind == "sphere":
        return Shape(kind, params, np.zeros((1, 3)), none, none, 0.0, params[0])
    if kind in ("cylinder", "capsule"):
        radius, half = params
        axis = np.array([[0.0, 0.0, half], [0.0, 0.0, -half]])
        if kind == "capsule":
            return Shape(kind, params, axis, none, z, 0.0, radius)
        return Shape(kind, params, axis, np.vstack([z, -z]), z, radius, 0.0)
    if kind == "cuboid":
        mesh = np.array(list(itertools.product(*[(-h, h) for h in params])))
    assert mesh is not None
    normals, edges = outline(points=mesh)
    return Shape(kind, params, mesh, normals, edges, 0.0, 0.0)


def random_mesh(*, rng: np.random.Generator, index: int) -> Array:
    """Ellipsoids with many vertices, rough hulls with few, thin wedges; hull vertices only."""
    if index == 0:  # like a skin: many nearly coplanar facets
        n = 162
        k = np.arange(n) + 0.5
        polar, turn = np.arccos(1 - 2 * k / n), np.pi * (1 + 5**0.5) * k
        points = np.stack(
            [np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], 1
        ) * [0.17, 0.11, 0.28]
    elif index < 4:  # like a segment of a ring: eight corners, flat sides
        inner, outer, half, turn = 0.35, rng.uniform(0.4, 0.8), rng.uniform(0.02, 0.2), 0.1
        points = np.array(
            [
                (r * np.cos(a), r * np.sin(a), z)
                for r in (inner, outer)
                for a in (-turn, turn)
                for z in (-half, half)
            ]
        )
        points -= [0.5 * (inner + outer), 0.0, 0.0]
    else:
        points = rng.normal(size=(rng.integers(8, 40), 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        points *= rng.uniform(0.02, 0.2, size=3)
    points = np.round(points, 6)
    return points[np.sort(ConvexHull(points).vertices)]


def make_shapes(*, rng: np.random.Generator) -> dict[str, list[Shape]]:
    shapes: dict[str, list[Shape]] = {}
    for kind in KINDS:
        count = {"sphere": 1, "cylinder": 2, "capsule": 2, "cuboid": 3, "convex": 0}[kind]
        pool = []
        for index in range(SHAPES_PER_KIND):
            params = tuple(np.round(10 ** rng.uniform(-2.3, -0.7, size=count), 4).tolist())
            mesh = random_mesh(rng=rng, index=index) if kind == "convex" else None
            pool.append(make_shape(kind=kind, params=params, mesh=mesh))
        shapes[kind] = pool
    return shapes


@dataclass(frozen=True)
class Pair:
    """Cores of A and of B in A's frame; B's frame is `rotation`, `translation`."""

    a: Shape
    b: Shape
    rotation: Array
    translation: Array

    def support(self, n: Array) -> Array:
        """Largest `n . x` over core A minus core B, for the rows of unit vectors `n`."""
        m = n @ self.rotation
        value = (n @ self.a.points.T).max(axis=1) + (-m @ self.b.points.T).max(axis=1)
        value += self.a.disc_m * np.hypot(n[:, 0], n[:, 1])
        value += self.b.disc_m * np.hypot(m[:, 0], m[:, 1])
        return value - n @ self.translation

    def support1(self, n: Array) -> float:
        return float(self.support((n / np.linalg.norm(n))[None])[0])


def inequalities(*, shape: Shape) -> tuple[Array, Array]:
    """`matrix @ x <= bound` for the core, without a cylinder's curved side."""
    if shape.kind in ("cuboid", "convex"):
        equations = ConvexHull(shape.points).equations
        return equations[:, :3], -equations[:, 3]
    half = np.abs(shape.points[:, 2]).max()
    return np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]), np.array([half, half])


def separated_distance(*, pair: Pair, guess_a: Array, guess_b: Array) -> tuple[float, float]:
    """Distance of the cores and the width of its certificate, or (0, inf)."""

    def certificate(pa: Array, pb: Array) -> tuple[float, float]:
        gap = float(np.linalg.norm(pb - pa))
        if gap < 1e-12:
            return 0.0, np.inf
        lower = -pair.support1((pb - pa) / gap)
        return lower, gap - lower

    best = certificate(guess_a, guess_b)
    if best[1] <= CERTIFIED_GAP_M:
        return best
    constraints = []
    for shape, part, rotation, shift in (
        (pair.a, slice(0, 3), np.eye(3), np.zeros(3)),
        (pair.b, slice(3, 6), pair.rotation, pair.translation),
    ):

        def local(x: Array, part=part, rotation=rotation, shift=shift) -> Array:
            return rotation.T @ (x[part] / SCALE - shift)

        if shape.kind in ("sphere", "capsule", "cylinder"):
            limit = shape.disc_m
            if limit > 0.0:
                constraints.append(
                    {
                        "type": "ineq",
                        "fun": lambda x, f=local, r=limit: SCALE * (r - f(x)[:2] @ f(x)[:2] / r),
                    }
                )
            else:
                constraints.append({"type": "eq", "fun": lambda x, f=local: SCALE * f(x)[:2]})
        matrix, bound = inequalities(shape=shape)
        constraints.append(
            {
                "type": "ineq",
                "fun": lambda x, f=local, m=matrix, b=bound: SCALE * (b - m @ f(x)),
            }
        )
    result = minimize(
        lambda x: float((x[3:] - x[:3]) @ (x[3:] - x[:3])),
        SCALE * np.concatenate([guess_a, guess_b]),
        jac=lambda x: 2.0 * np.concatenate([x[:3] - x[3:], x[3:] - x[:3]]),
        method="SLSQP",
        constraints=constraints,
        options={"ftol": 1e-18, "maxiter": 500},
    )
    refined = certificate(result.x[:3] / SCALE, result.x[3:] / SCALE)
    best = min(best, refined, key=lambda c: abs(c[1]))
    # Any direction bounds the distance from below: climb that bound as well.
    if best[1] > CERTIFIED_GAP_M:
        start = result.x[3:] - result.x[:3]
        if np.linalg.norm(start) < 1e-9:
            return 0.0, np.inf
        climbed = minimize(
            lambda n: pair.support1(n),
            start / np.linalg.norm(start),
            method="Nelder-Mead",
            options={"xatol": 1e-14, "fatol": 1e-16, "maxiter": 4000},
        )
        lower = max(best[0], -float(climbed.fun))
        best = (lower, best[0] + best[1] - lower)
    return best


SCALE = 10.0  # SLSQP's tolerances are absolute: decimetres keep its problem near unity


def depth(*, pair: Pair) -> float:
    """Least overlap of the cores over all directions: the penetration depth."""
    if pair.a.disc_m == 0.0 and pair.b.disc_m == 0.0:
        points = (
            pair.a.points[:, None, :] - (pair.b.points @ pair.rotation.T + pair.translation)[None]
        ).reshape(-1, 3)
        if np.linalg.matrix_rank(points - points[0], tol=1e-9) < 3:
            return 0.0  # segments and points have no volume to penetrate
        return float(-ConvexHull(points).equations[:, 3].max())
    fixed = [pair.a.normals, -pair.b.normals @ pair.rotation.T]
    edges_a, edges_b = pair.a.edges, pair.b.edges @ pair.rotation.T
    if len(edges_a) and len(edges_b):
        cross = np.cross(edges_a[:, None, :], edges_b[None]).reshape(-1, 3)
        cross = cross[np.linalg.norm(cross, axis=1) > 1e-9]
        cross /= np.linalg.norm(cross, axis=1, keepdims=True)
        fixed += [cross, -cross]
    normals = np.vstack(fixed)
    best = float(pair.support(normals).min()) if len(normals) else np.inf
    for edge in np.vstack([edges_a, edges_b]):
        best = min(best, least_on_circle(pair=pair, axis=edge))
    if pair.a.disc_m > 0.0 and pair.b.disc_m > 0.0:
        best = min(best, least_on_sphere(pair=pair))
    return best


def least_on_circle(*, pair: Pair, axis: Array) -> float:
    basis = np.linalg.svd(axis[None])[2][1:]
    count = 720
    angle = 2.0 * np.pi * np.arange(count) / count
    values = pair.support(np.stack([np.cos(angle), np.sin(angle)], 1) @ basis)
    lower = np.flatnonzero((values <= np.roll(values, 1)) & (values <= np.roll(values, -1)))
    best = np.inf
    for index in lower[np.argsort(values[lower])][:3]:
        found = minimize_scalar(
            lambda t: pair.support1(np.cos(t) * basis[0] + np.sin(t) * basis[1]),
            bounds=(angle[index] - 2.0 * np.pi / count, angle[index] + 2.0 * np.pi / count),
            method="bounded",
            options={"xatol": 1e-13},
        )
        best = min(best, float(found.fun), float(values[index]))
    return best


def least_on_sphere(*, pair: Pair) -> float:
    n = 20000
    k = np.arange(n) + 0.5
    polar, turn = np.arccos(1 - 2 * k / n), np.pi * (1 + 5**0.5) * k
    grid = np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], 1)
    values = pair.support(grid)
    best, starts = np.inf, []
    for index in np.argsort(values):
        if all(grid[index] @ s < 0.995 for s in starts):
            starts.append(grid[index])
        if len(starts) == 8:
            break
    for start in starts:
        basis = np.linalg.svd(start[None])[2][1:]
        found = minimize(
            lambda t, n=start, side=basis: pair.support1(n + t @ side),
            np.zeros(2),
            method="Nelder-Mead",
            options={"xatol": 1e-12, "fatol": 1e-16, "maxiter": 2000},
        )
        best = min(best, float(found.fun))
    return best


def coal_shape(*, shape: Shape) -> coal.CollisionGeometry:
    p = shape.params
    if shape.kind == "sphere":
        return coal.Sphere(p[0])
    if shape.kind == "cylinder":
        return coal.Cylinder(p[0], 2.0 * p[1])
    if shape.kind == "capsule":
        return coal.Capsule(p[0], 2.0 * p[1])
    if shape.kind == "cuboid":
        return coal.Box(*(2.0 * h for h in p))
    vertices = coal.StdVec_Vec3s()
    vertices.extend([np.array(v) for v in shape.points])
    return coal.Convex.convexHull(vertices, True, "Qt")


def coal_distance(*, shape_a: Shape, shape_b: Shape, rotation: Array, translation: Array):
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    request.gjk_tolerance = 1e-10
    request.gjk_max_iterations = 1000
    request.epa_tolerance = 1e-10
    request.epa_max_iterations = 1000
    result = coal.DistanceResult()
    value = coal.distance(
        coal_shape(shape=shape_a),
        coal.Transform3s(np.eye(3), np.zeros(3)),
        coal_shape(shape=shape_b),
        coal.Transform3s(rotation, translation),
        request,
        result,
    )
    # Coal gives up with -inf or the lowest finite number, and with points as large.
    value = float(value) if value > -1e6 else float("-inf")
    return value, np.array(result.getNearestPoint1()), np.array(result.getNearestPoint2())


def signed_distance(*, pair: Pair) -> tuple[float, float, float]:
    """Reference, width of its certificate (NaN where penetrating) and Coal's own answer."""
    a, b = pair.a, pair.b
    args = {"rotation": pair.rotation, "translation": pair.translation}
    coal_value, point_a, point_b = coal_distance(shape_a=a, shape_b=b, **args)
    towards_b = point_b - point_a
    if coal_value < 0.0:
        towards_b = -towards_b
    if np.linalg.norm(towards_b) > 1e-12:
        towards_b = towards_b / np.linalg.norm(towards_b)
    core_a, core_b = point_a - a.radius_m * towards_b, point_b + b.radius_m * towards_b
    radius = a.radius_m + b.radius_m
    # Where the cores overlap, or Coal gave up, its points say nothing.
    if not np.isfinite(coal_value) or (radius > 0.0 and coal_value + radius <= 1e-6):
        core_a, core_b = np.zeros(3), pair.translation
    distance, width = separated_distance(pair=pair, guess_a=core_a, guess_b=core_b)
    if distance > 1e-10 and width < 1e-9:
        return distance - radius, width, coal_value
    return -depth(pair=pair) - radius, float("nan"), coal_value


def random_pose(*, rng: np.random.Generator, reach: float) -> tuple[Array, Array]:
    """A fifth along the axes (parallel, coaxial, concentric), the rest at random."""
    if rng.random() < 0.2:
        rotation = Rotation.create_group("O")[int(rng.integers(24))]
        translation = rng.integers(-1, 2, size=3) * rng.uniform(0.0, 1.0) * reach
        if rng.random() < 0.5:
            translation *= np.eye(3)[rng.integers(3)]
    else:
        rotation = Rotation.random(rng=rng)
        translation = rng.normal(size=3)
        translation *= rng.uniform(0.0, 1.3) * reach / np.linalg.norm(translation)
    return np.round(rotation.as_quat(), 6), np.round(translation, 7)


def rotation_of(*, quat_xyzw: Array) -> Array:
    return Rotation.from_quat(quat_xyzw).as_matrix()


def make_case(*, rng: np.random.Generator, a: Shape, b: Shape):
    reach = sum(np.linalg.norm(s.points, axis=1).max() + s.disc_m + s.radius_m for s in (a, b))
    quat, translation = random_pose(rng=rng, reach=float(reach))
    rotation = rotation_of(quat_xyzw=quat)
    if rng.random() < 0.3:  # bring the pair close to touching, from either side
        value, point_a, point_b = coal_distance(
            shape_a=a, shape_b=b, rotation=rotation, translation=translation
        )
        towards_b = (point_b - point_a) * np.sign(value)
        if np.isfinite(value) and np.linalg.norm(towards_b) > 1e-9:
            wanted = rng.choice(NEAR_TOUCHING_M) * rng.choice([-1.0, 1.0])
            towards_b /= np.linalg.norm(towards_b)
            translation = np.round(translation + (wanted - value) * towards_b, 9)
    pair = Pair(a=a, b=b, rotation=rotation, translation=translation)
    value, width, coal_value = signed_distance(pair=pair)
    return quat, translation, value, width, coal_value


def main() -> None:
    rng = np.random.default_rng(SEED)
    shapes = make_shapes(rng=rng)
    pairs = []
    for kind_a, kind_b in itertools.combinations_with_replacement(KINDS, 2):
        cases, widths, errors = [], [], {True: [], False: []}
        for _ in range(CASES_PER_PAIR):
            ia, ib = (int(i) for i in rng.integers(SHAPES_PER_KIND, size=2))
            quat, translation, value, width, coal_value = make_case(
                rng=rng, a=shapes[kind_a][ia], b=shapes[kind_b][ib]
            )
            widths.append(width)
            if np.isfinite(coal_value):
                errors[value > 0.0].append(coal_value - value)
            pose = [float(x) for x in (*translation, *quat)]
            coals = float(f"{coal_value:.13f}") if np.isfinite(coal_value) else None
            cases.append([ia, ib, *pose, float(f"{value:.13f}"), coals])
        pairs.append({"kinds": [kind_a, kind_b], "cases": cases})
        apart, inside = np.array(errors[True]), np.array(errors[False])
        print(
            f"{kind_a:9}{kind_b:9} certificate {np.nanmax(widths) * 1e6:9.2e} um | Coal um: "
            f"{len(apart):3} apart {apart.min() * 1e6:9.2e} .. {apart.max() * 1e6:9.2e}, "
            f"{len(inside):3} penetrating {inside.min() * 1e6:9.2e} .. {inside.max() * 1e6:9.2e}",
            file=sys.stderr,
            flush=True,
        )
    document = {
        "about": "Signed distances of convex pairs; made by make_reference.py. Metres. "
        "case: index a, index b, a_from_b translation xyz, quaternion xyzw (to be normalised), "
        "reference, Coal's own answer (null: none).",
        "tools": {
            "coal": coal.__version__,
            "numpy": np.__version__,
            "scipy": scipy.__version__,
        },
        "seed": SEED,
        "shapes": {
            kind: [s.points.tolist() if kind == "convex" else list(s.params) for s in shapes[kind]]
            for kind in KINDS
        },
        "pairs": pairs,
    }
    text = json.dumps(document, separators=(",", ":")).replace("],[", "],\n[")
    Path(__file__).with_name("reference.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""Bounds of a signed distance that a reader can check: no iteration decides them.

The signed distance of two convex sets is the largest gap between them over all directions, in
penetration as well: `s = max_n (min_B n . b - max_A n . a)`. So the gap along *any* unit vector is
a lower bound of `s`, and the distance of *any* two points of the sets an upper bound while they are
apart. Both take support functions and containment only.
"""

import numpy as np
from cell import Shape

Array = np.ndarray

# Directions that a search starts from, and how many of the best are refined.
DIRECTIONS = 4000
REFINED = 12
# Where an optimum is as sharp as that of two crossed cylinders' rims, the search ends a nanometre below it.
PROJECTIONS = 20000


def spread_directions(count: int) -> Array:
    """Unit vectors spread evenly over the sphere (Fibonacci's spiral)."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    turn = np.pi * (1.0 + 5.0**0.5) * k
    across = np.sqrt(1.0 - z * z)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), z])


SPREAD = spread_directions(DIRECTIONS)


def gap(*, a: Shape, b: Shape, pose_a: tuple, pose_b: tuple, n: Array) -> Array:
    """Gap of A and B along every row of `n` (world, A towards B).

    Poses are rotations and positions: one of each, or one per row.
    """

    def to_local(rotation: Array, direction: Array) -> Array:
        if rotation.ndim == 2:
            return direction @ rotation
        return np.einsum("kij,ki->kj", rotation, direction)

    between = pose_b[1] - pose_a[1]
    along = np.einsum("kj,kj->k", n, np.broadcast_to(between, n.shape))
    reach_a = a.support(to_local(pose_a[0], n))
    reach_b = b.support(to_local(pose_b[0], -n))
    return along - reach_a - reach_b


def direction_between(*, a: Shape, b: Shape, pose_a: tuple, pose_b: tuple, start: Array) -> Array | None:
    """Direction between the nearest points of two shapes apart, by projections onto one and the other in turn."""

    def onto(shape: Shape, pose: tuple, x: Array) -> Array | None:
        near = shape.nearest((x - pose[1]) @ pose[0])
        return None if near is None else pose[0] @ near + pose[1]

    on_a = start
    for _ in range(PROJECTIONS):
        on_b = onto(b, pose_b, on_a)
        again = None if on_b is None else onto(a, pose_a, on_b)
        if again is None:
            return None
        moved, on_a = np.linalg.norm(again - on_a), again
        if moved == 0.0:
            break
    return on_b - on_a


def widest_gap(
    *, a: Shape, b: Shape, pose_a: tuple, pose_b: tuple, hints: Array, enough: float
) -> float:
    """Largest gap over all directions that a dense search with refinement finds, a lower bound of
    the signed distance; `hints` are tried besides. Stops when the gap is `enough`."""

    def of(n: Array) -> Array:
        return gap(a=a, b=b, pose_a=pose_a, pose_b=pose_b, n=n)

    # The cylinders' own directions: optima lie on their axes and across them.
    axes = np.vstack([pose_a[0].T, pose_b[0].T, np.cross(pose_a[0][:, 2], pose_b[0][:, 2])[None]])
    between = direction_between(a=a, b=b, pose_a=pose_a, pose_b=pose_b, start=pose_a[1])
    if between is not None:
        hints = np.vstack([hints, between])
    start = np.vstack([SPREAD, hints, axes, -axes])
    length = np.linalg.norm(start, axis=1)
    start = start[length > 1e-9] / length[length > 1e-9, None]
    value = of(start)
    order = np.argsort(-value)[:REFINED]
    best, directions = value[order], start[order]
    random = np.random.default_rng(1)
    step = np.full(len(order), 3.0 / np.sqrt(DIRECTIONS))
    # A pattern search: no gradient, because the gap has kinks just where it is largest.
    while step.max() > 1e-10 and best.max() < enough:
        trial = directions[:, None, :] + step[:, None, None] * random.normal(
            size=(len(order), 16, 3)
        )
        trial /= np.linalg.norm(trial, axis=2, keepdims=True)
        values = of(trial.reshape(-1, 3)).reshape(len(order), 16)
        choice = values.argmax(axis=1)
        rows = np.arange(len(order))
        better = values[rows, choice] > best
        best = np.where(better, values[rows, choice], best)
        directions[better] = trial[rows, choice][better]
        step = np.where(better, step * 1.1, step * 0.7)
        step = np.minimum(step, 0.1)
    return float(best.max())

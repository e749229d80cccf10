"""A chest of analytic solids as a CT volume: signed distances, coverage by a ramp, blur, noise.

Millimetres, x to the left, y posterior, z towards the head; the first voxel is at the origin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

Array = np.ndarray
Distance = Callable[[Array, Array, Array], Array]

MIDDLE = np.array([179.0, 179.0, 150.0])


def ellipse(*, at: tuple[float, float], axes: tuple[float, float]) -> Distance:
    """Distance from an upright elliptic cylinder, to second order near its surface."""

    def distance(x: Array, y: Array, z: Array) -> Array:
        u, v = (x - at[0]) / axes[0], (y - at[1]) / axes[1]
        value = u * u + v * v - 1.0
        slope = 2.0 * np.hypot(u / axes[0], v / axes[1])
        return value / np.maximum(slope, 1e-3) + 0.0 * z

    return distance


def ellipsoid(*, at: tuple[float, float, float], axes: tuple[float, float, float]) -> Distance:
    """Distance from an ellipsoid, to second order near its surface."""

    def distance(x: Array, y: Array, z: Array) -> Array:
        u, v, w = (x - at[0]) / axes[0], (y - at[1]) / axes[1], (z - at[2]) / axes[2]
        value = u * u + v * v + w * w - 1.0
        slope = 2.0 * np.sqrt((u / axes[0]) ** 2 + (v / axes[1]) ** 2 + (w / axes[2]) ** 2)
        return value / np.maximum(slope, 1e-3)

    return distance


def capsule(*, a: tuple[float, float, float], b: tuple[float, float, float], r: float) -> Distance:
    """Distance from a capsule."""
    start, way = np.array(a), np.array(b) - np.array(a)

    def distance(x: Array, y: Array, z: Array) -> Array:
        px, py, pz = x - start[0], y - start[1], z - start[2]
        t = np.clip((px * way[0] + py * way[1] + pz * way[2]) / max(way @ way, 1e-9), 0, 1)
        return np.sqrt((px - t * way[0]) ** 2 + (py - t * way[1]) ** 2 + (pz - t * way[2]) ** 2) - r

    return distance


def ring(*, z0: float, axes: tuple[float, float], r: float) -> Distance:
    """Distance from a tube along an ellipse in a transverse plane: a rib."""
    flat = ellipse(at=(0.0, 0.0), axes=axes)

    def distance(x: Array, y: Array, z: Array) -> Array:
        return np.hypot(flat(x, y, z), z - z0) - r

    return distance


@dataclass(frozen=True)
class Solid:
    """A solid and its density; later ones replace earlier ones."""

    name: str
    distance: Distance
    hu: float
    low: tuple[float, float, float] = (-200.0, -200.0, -200.0)
    high: tuple[float, float, float] = (200.0, 200.0, 200.0)


RIB_LEVELS = tuple(range(-112, 121, 28))
RIB_AXES = (150.0, 97.0)
RIB_RADIUS = 4.8
SKIN = ellipse(at=(0.0, 0.0), axes=(165.0, 110.0))
LUNGS = {
    "lung_left": ellipsoid(at=(76.0, 0.0, 10.0), axes=(58.0, 78.0, 118.0)),
    "lung_right": ellipsoid(at=(-76.0, 0.0, 10.0), axes=(58.0, 78.0, 118.0)),
}
NODULES = ((-80.0, 30.0, 20.0, 6.0), (70.0, -40.0, -30.0, 4.0), (-131.0, 5.0, 15.0, 8.0))


def ribs(x: Array, y: Array, z: Array) -> Array:
    """Distance from the nearest rib."""
    return np.minimum.reduce([ring(z0=level, axes=RIB_AXES, r=RIB_RADIUS)(x, y, z) for level in RIB_LEVELS])


def chest() -> list[Solid]:
    """The chest, in the order in which solids replace each other."""

    def bed(x: Array, y: Array, z: Array) -> Array:
        outer = np.abs(np.hypot(x, y - (110.0 - 420.0)) - 421.5) - 1.5
        return np.maximum(outer, np.abs(x) - 190.0) + 0.0 * z

    solids = [Solid("bed", bed, -100.0, low=(-200.0, 0.0, -200.0)), Solid("skin", SKIN, 40.0)]
    for name, lung in LUNGS.items():
        solids.append(Solid(name, lung, -850.0))
    heart = ellipsoid(at=(18.0, -25.0, -30.0), axes=(50.0, 42.0, 55.0))
    solids.append(Solid("heart", heart, 45.0))
    random = np.random.default_rng(7)
    for side in (-1.0, 1.0):
        root = (side * 35.0, 12.0, 5.0)
        for _ in range(14):
            way = random.normal(size=3)
            way *= random.uniform(35, 60) / np.linalg.norm(way)
            end = (root[0] + side * abs(way[0]), root[1] + way[1], root[2] + 1.3 * way[2])
            r = random.uniform(0.8, 3.0)
            solids.append(Solid("vessel", capsule(a=root, b=end, r=r), 45.0, *box(root, end, r + 3)))
    for side in (-1.0, 1.0):
        a, b = (0.0, 10.0, 45.0), (side * 52.0, 14.0, 5.0)
        solids.append(Solid("wall", capsule(a=a, b=b, r=7.5), 30.0, *box(a, b, 10)))
    top = (0.0, 10.0, 180.0)
    solids.append(Solid("wall", capsule(a=(0.0, 10.0, 45.0), b=top, r=10.5), 30.0, *box((0, 10, 45), top, 14)))
    for side in (-1.0, 1.0):
        a, b = (0.0, 10.0, 45.0), (side * 54.0, 14.0, 3.0)
        solids.append(Solid("airway", capsule(a=a, b=b, r=6.0), -1000.0, *box(a, b, 10)))
    solids.append(Solid("airway", capsule(a=(0.0, 10.0, 45.0), b=top, r=9.0), -1000.0, *box((0, 10, 45), top, 14)))
    for x, y, z, r in NODULES:
        nodule = capsule(a=(x, y, z), b=(x, y, z), r=r)
        solids.append(Solid("nodule", nodule, 40.0, *box((x, y, z), (x, y, z), r + 3)))
    for level in RIB_LEVELS:
        rib = ring(z0=level, axes=RIB_AXES, r=RIB_RADIUS)
        solids.append(Solid("rib", rib, 700.0, (-160.0, -110.0, level - 9.0), (160.0, 110.0, level + 9.0)))
    spine = (-25.0, 45.0, -200.0), (25.0, 105.0, 200.0)
    solids.append(Solid("spine", ellipse(at=(0.0, 76.0), axes=(18.0, 15.0)), 700.0, *spine))
    solids.append(Solid("marrow", ellipse(at=(0.0, 76.0), axes=(15.5, 12.5)), 200.0, *spine))
    return solids


def box(a: tuple[float, ...], b: tuple[float, ...], margin: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The box around two points, with a margin."""
    low = tuple(float(v) for v in np.minimum(a, b) - margin)
    high = tuple(float(v) for v in np.maximum(a, b) + margin)
    return low, high


def scan(*, size: tuple[int, int, int], spacing: tuple[float, float, float], noise: float, seed: int = 1) -> Array:
    """A CT volume, k first as the program reads it: 16-bit Hounsfield units."""
    nx, ny, nz = size
    # Slices integrate over their thickness: sub-slices of about 1 mm, averaged.
    sub = max(1, round(spacing[2] / 1.0))
    x = (np.arange(nx) * spacing[0] - MIDDLE[0]).astype(np.float32)
    y = (np.arange(ny) * spacing[1] - MIDDLE[1]).astype(np.float32)
    volume = np.empty((nz, ny, nx), np.int16)
    random = np.random.default_rng(seed)
    solids = chest()
    sigma = 0.55 / spacing[0]
    for k in range(nz):
        slab = np.zeros((ny, nx), np.float32)
        for part in range(sub):
            z = k * spacing[2] + ((part + 0.5) / sub - 0.5) * spacing[2] - MIDDLE[2]
            slab += paint(solids, x, y, z, spacing[0], spacing[2] / sub) / sub
        slab = ndimage.gaussian_filter(slab, sigma, mode="nearest")
        slab += noise * random.standard_normal(slab.shape, np.float32)
        volume[k] = np.clip(np.rint(slab), -1024, 3071).astype(np.int16)
    return volume


def paint(solids: list[Solid], x: Array, y: Array, z: float, pixel: float, thick: float) -> Array:
    """One slice: coverage of a voxel by a plane at the distance of its middle."""
    image = np.full((len(y), len(x)), -1000.0, np.float32)
    for solid in solids:
        if not solid.low[2] - thick <= z <= solid.high[2] + thick:
            continue
        i = np.flatnonzero((x >= solid.low[0]) & (x <= solid.high[0]))
        j = np.flatnonzero((y >= solid.low[1]) & (y <= solid.high[1]))
        window = np.s_[j[0] : j[-1] + 1, i[0] : i[-1] + 1]
        cover = 0.0
        # Two heights and a ramp of a pixel: the slice's own thickness in full.
        for part in (-0.375, -0.125, 0.125, 0.375):
            beyond = solid.distance(x[i][None, :], y[j][:, None], np.float32(z + part * thick))
            cover = cover + 0.25 * np.clip(0.5 - beyond / pixel, 0.0, 1.0)
        image[window] += cover * (solid.hu - image[window])
    return image

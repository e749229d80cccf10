"""Chests drawn at random as CT volumes, each with the truth of every voxel: what no segmentation has seen.

Millimetres in the scan's frame, x to the left, y posterior, z towards the head, the middle of the chest at the origin.
Nothing of the anatomy is taken from needlebench: ellipses, capsules and half-spaces, sizes of adults with margins
(assumed). Bones have a cortex of 1.5 mm.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
from phantom import Array, Distance, Solid, box, capsule, ellipse, ellipsoid
from scipy import ndimage

# What a needle passes; the order is that of the labels from 1 on.
TISSUES = (
    "soft", "fat", "bone", "cartilage", "heart", "vessel", "lung", "lung_vessel", "airway", "liver", "stomach", "gas",
    "nodule", "fluid", "arm", "couch", "foam", "metal",
)  # fmt: skip
LABEL = {name: index + 1 for index, name in enumerate(TISSUES)}


@dataclass
class Chest:
    """A scanned chest: Hounsfield units and labels, k first, and where the voxels are."""

    hu: Array
    truth: Array
    spacing: tuple[float, float, float]
    first: Array
    nodules: list[tuple[float, float, float, float]]
    words: list[str]
    # Half axes of the skin.
    half: tuple[float, float]
    # Middle and radius of the reconstruction circle, or none.
    circle: tuple[float, float, float] | None = None
    # Solids by name, for label maps.
    named: dict[str, Array] = field(default_factory=dict)


def clipped(*distances: Distance) -> Distance:
    """The intersection of solids."""

    def distance(x: Array, y: Array, z: Array) -> Array:
        found = distances[0](x, y, z)
        for each in distances[1:]:
            found = np.maximum(found, each(x, y, z))
        return found

    return distance


def inside(solid: Distance, by: float) -> Distance:
    """A solid that is smaller on all sides."""
    return lambda x, y, z: solid(x, y, z) + by


def above(height: float, dome: float, middle: float, width: float) -> Distance:
    """What lies above a diaphragm: a dome of that rise over its middle at x."""

    def distance(x: Array, y: Array, z: Array) -> Array:
        # A slope of one half at most: scaled, the value is no more than the distance.
        top = height + dome * np.exp(-(((x - middle) / width) ** 2) - (y / width) ** 2)
        return 0.85 * (top - z)

    return distance


class Drawing:
    """Draws the sizes of one chest and its solids, in the order in which they replace each other."""

    def __init__(self, number: int) -> None:
        """`number` decides all: which of the kinds, and every size."""
        self.random = np.random.default_rng([33, number])
        self.number = number
        self.solids: list[tuple[str, str, Solid]] = []
        self.words: list[str] = []
        self.nodules: list[tuple[float, float, float, float]] = []
        self.contrast = number % 5 in (1, 3)
        self.one_lung = {7: "white lung", 17: "pleural effusion", 27: "pneumothorax"}.get(number % 40)
        self.arms = number % 3 == 1
        self.metal = number % 13 == 5
        if self.contrast:
            self.blood = float(self.random.uniform(150, 380))
            self.words.append(f"contrast {self.blood:.0f} HU")
        else:
            self.blood = 45.0
        self.draw()

    def uniform(self, low: float, high: float) -> float:
        """A drawn size."""
        return float(self.random.uniform(low, high))

    def add(
        self, tissue: str, name: str, distance: Distance, hu: float, ends: tuple[tuple[float, ...], ...] | None = None
    ) -> None:
        """Puts a solid over those before."""
        low, high = ends or ((-1e3,) * 3, (1e3,) * 3)
        self.solids.append((tissue, name, Solid(name, distance, hu, low, high)))

    def tube(self, tissue: str, name: str, points: list[tuple[float, float, float]], r: float, hu: float) -> None:
        """A chain of capsules."""
        for a, b in itertools.pairwise(points):
            self.add(tissue, name, capsule(a=a, b=b, r=r), hu, box(a, b, r + 4))

    def bony(self, name: str, distance: Distance, ends: tuple[tuple[float, ...], ...], marrow: float = 200.0) -> None:
        """Cortex and marrow."""
        self.add("bone", name, distance, self.uniform(600, 1100), ends)
        self.add("bone", name, inside(distance, 1.5), marrow, ends)

    def draw(self) -> None:
        """The whole chest."""
        self.half = (self.uniform(135, 185), self.uniform(95, 130))
        fat = self.uniform(5, min(30.0, self.half[1] - 82))
        a, b = self.half
        skin = ellipse(at=(0.0, 0.0), axes=(a, b))
        self.cage = (a - fat - self.uniform(12, 18), b - fat - self.uniform(7, 12))
        self.couch(b)
        if self.arms:
            self.beside(a)
        self.add("fat", "body", skin, self.uniform(-115, -85))
        self.add("soft", "muscle", ellipse(at=(0.0, 0.0), axes=(a - fat, b - fat)), 50.0)
        self.back()
        self.lungs()
        self.middle()
        self.below()
        self.bones()
        if self.metal:
            p = (self.uniform(60, 80), -b + fat + 4.0, 70.0)
            self.add("metal", "pacemaker", ellipsoid(at=p, axes=(20.0, 5.0, 18.0)), 3000.0, box(p, p, 24))
            self.tube("metal", "lead", [p, (30.0, -30.0, 90.0), (5.0, -20.0, -20.0)], 1.2, 3000.0)
            self.words.append("pacemaker")

    def couch(self, b: float) -> None:
        """A curved couch under a mattress that no threshold sees, which the back touches or not."""
        gap, r = self.uniform(-1.0, 6.0), self.uniform(380, 600)

        def shell(x: Array, y: Array, z: Array) -> Array:
            off = np.hypot(x, y - (b + gap + 12 - r))
            return np.maximum(np.abs(off - r) - 2.0, np.abs(x) - 210.0) + 0.0 * z

        def mattress(x: Array, y: Array, z: Array) -> Array:
            off = np.hypot(x, y - (b + gap + 12 - r))
            return np.maximum(np.abs(off - r + 6.0) - 4.0, np.abs(x) - 190.0) + 0.0 * z

        self.add("foam", "mattress", mattress, self.uniform(-960, -880))
        self.add("couch", "couch", shell, self.uniform(-300, 0))

    def beside(self, a: float) -> None:
        """Arms beside the body, along it."""
        self.words.append("arms beside the body")
        for side in (-1.0, 1.0):
            r = self.uniform(34, 46)
            x, y = side * (a + r + self.uniform(3, 18)), self.uniform(10, 50)
            ends = ((x, y, -400.0), (x + side * 8, y, 400.0))
            self.add("arm", "arm", capsule(a=ends[0], b=ends[1], r=r), -80.0)
            self.add("arm", "arm", capsule(a=ends[0], b=ends[1], r=r - 8), 50.0)
            self.add("arm", "humerus", capsule(a=ends[0], b=ends[1], r=11.0), 900.0)
            self.add("arm", "humerus", capsule(a=ends[0], b=ends[1], r=8.0), 100.0)

    def back(self) -> None:
        """Shoulder blades behind the ribs, upper half."""
        for side in (-1.0, 1.0):
            x, y = side * self.cage[0] * 0.62, self.cage[1] * 0.86 + 5
            at = (x, y, 85.0)
            solid = clipped(
                ellipsoid(at=at, axes=(36.0, 4.5, 60.0)), ellipse(at=(0.0, 0.0), axes=(self.half[0] - 4, self.half[1] - 4))
            )
            self.bony(f"scapula_{'left' if side > 0 else 'right'}", solid, box(at, at, 66))

    def lungs(self) -> None:
        """Lungs within the ribs, with vessels and nodules, one of them ill where asked for."""
        wall = (self.cage[0] - 9, self.cage[1] - 9)
        self.spine_y = self.cage[1] * 0.66
        self.diaphragm = self.uniform(-105, -70)
        for side, name in ((1.0, "lung_left"), (-1.0, "lung_right")):
            lung = clipped(
                ellipsoid(at=(0.0, 0.0, self.diaphragm), axes=(wall[0], wall[1], self.uniform(215, 250))),
                ellipse(at=(0.0, 0.0), axes=wall),
                lambda x, y, z, side=side: 32.0 - side * x + 0.0 * (y + z),
                above(self.diaphragm, self.uniform(25, 45), side * wall[0] * 0.5, 75.0),
            )
            hu = self.uniform(-880, -780)
            ill = self.one_lung if side < 0 else None
            if ill == "white lung":
                self.add("fluid", name, lung, 35.0)
                self.words.append(ill)
                continue
            self.add("lung", name, lung, hu)
            if ill == "pneumothorax":
                front = clipped(lung, lambda x, y, z: y + 25.0 + 0.0 * (x + z))
                self.add("gas", "pneumothorax", front, -1000.0)
                self.words.append(ill)
            if ill == "pleural effusion":
                behind = clipped(lung, lambda x, y, z: 25.0 - y + 0.0 * (x + z))
                self.add("fluid", "effusion", behind, 15.0)
                self.words.append(ill)
            self.tree(side, lung)
            for _ in range(2):
                self.nodule(side, lung)

    def tree(self, side: float, lung: Distance) -> None:
        """Vessels of a lung, from its root outwards."""
        root = (side * 38.0, 10.0, 0.0)
        for _ in range(16):
            way = self.random.normal(size=3) * (1.0, 0.8, 1.4)
            way[0] = side * abs(way[0])
            way *= self.uniform(30, 70) / np.linalg.norm(way)
            end = tuple(np.array(root) + way)
            r = self.uniform(1.0, 4.0)
            vessel = clipped(capsule(a=root, b=end, r=r), lung)
            self.add("lung_vessel", "lung_vessel", vessel, self.blood, box(root, end, r + 3))
            for _ in range(2):
                turn = self.random.normal(size=3) * 25.0
                tip = tuple(np.array(end) + way * 0.4 + turn)
                branch = clipped(capsule(a=end, b=tip, r=0.6 * r), lung)
                self.add("lung_vessel", "lung_vessel", branch, self.blood, box(end, tip, r + 3))

    def nodule(self, side: float, lung: Distance) -> None:
        """A solid nodule, wholly in the lung or at its wall."""
        for _ in range(200):
            p = (side * self.uniform(65, self.cage[0] - 12), self.uniform(-70, 60), self.uniform(-50, 80))
            r = self.uniform(3.5, 12.0)
            deep = -float(lung(*np.array(p).reshape(3, 1))[0])
            if deep > 0.3 * r and all(np.linalg.norm(np.subtract(p, each[:3])) > r + each[3] + 8 for each in self.nodules):
                self.nodules.append((*p, r))
                ball = clipped(capsule(a=p, b=p, r=r), inside(lung, -2.0))
                self.add("nodule", "nodule", ball, self.uniform(10, 60), box(p, p, r + 3))
                return

    def middle(self) -> None:
        """Heart, great vessels, airways, gullet."""
        x, y, z = self.uniform(12, 24), self.uniform(-35, -22), self.uniform(-45, -25)
        at = (x, y, z)
        self.add("heart", "heart", ellipsoid(at=at, axes=(48.0, 36.0, 50.0)), self.blood, box(at, at, 56))
        r = self.uniform(11, 15)
        arch = [(-8.0, -22.0, 0.0), (-8.0, -24.0, 45.0), (4.0, -8.0, 62.0), (18.0, 22.0, 55.0), (20.0, 34.0, 30.0)]
        down = [(20.0, 34.0, 30.0), (18.0, 36.0, -220.0)]
        self.tube("vessel", "aorta", [*arch, *down[1:]], r, self.blood)
        self.tube("vessel", "superior_vena_cava", [(-24.0, -18.0, -5.0), (-24.0, -14.0, 90.0)], 9.0, self.blood)
        self.tube("vessel", "pulmonary_artery", [(14.0, -30.0, 0.0), (10.0, -5.0, 22.0)], 13.0, self.blood)
        for side in (-1.0, 1.0):
            self.tube("vessel", "pulmonary_artery", [(10.0, -5.0, 22.0), (side * 42.0, 8.0, 10.0)], 9.0, self.blood)
            # Beside the breastbone, behind the cartilages.
            x, y = side * self.uniform(24, 32), -self.cage[1] + self.uniform(7, 9)
            self.tube("vessel", "internal_thoracic", [(x, y, -60.0), (x, y, 110.0)], 1.5, self.blood)
        fork = (0.0, 14.0, 35.0)
        ways = [[(0.0, 6.0, 220.0), fork], *([fork, (side * 42.0, 16.0, 2.0)] for side in (-1.0, 1.0))]
        for r, hu, tissue in ((10.5, 30.0, "soft"), (9.0, -1000.0, "airway")):
            for way in ways:
                self.tube(tissue, "trachea" if tissue == "airway" else "airway_wall", way, r, hu)
        if self.random.random() < 0.5:
            self.tube("airway", "gullet_gas", [(6.0, 30.0, 60.0), (6.0, 30.0, 90.0)], 4.0, -900.0)

    def below(self) -> None:
        """Liver and stomach below the diaphragm."""
        inner = ellipse(at=(0.0, 0.0), axes=(self.cage[0] - 8, self.cage[1] - 8))
        for side, name, hu in ((-1.0, "liver", 60.0), (1.0, "stomach", 40.0)):
            half = clipped(inner, lambda x, y, z, side=side: 6.0 - side * x + 0.0 * (y + z))
            organ = clipped(half, lambda x, y, z: z - self.diaphragm + 4.0 + 0.0 * (x + y))
            self.add(name, name, organ, hu)
        p = (60.0, -30.0, self.diaphragm - 28)
        self.add("gas", "stomach_gas", ellipsoid(at=p, axes=(30.0, 18.0, 16.0)), -950.0, box(p, p, 34))

    def bones(self) -> None:
        """Ribs that descend to the front and end in cartilage, breastbone, spine, collar bones."""
        slope = self.uniform(0.25, 0.45)
        front = self.uniform(38, 52)
        calcified = self.uniform(80, 130)
        flat = ellipse(at=(0.0, 0.0), axes=self.cage)
        lean = 1.0 / np.sqrt(1.0 + slope**2)
        for index in range(11):
            z0 = 140.0 - self.uniform(28.0, 29.0) * index
            r = self.uniform(3.5, 5.0)

            def rib(x: Array, y: Array, z: Array, z0: float = z0, r: float = r) -> Array:
                return np.hypot(flat(x, y, z), (z - z0 - slope * y) * lean) - r

            def is_front(x: Array, y: Array, z: Array) -> Array:
                return np.maximum(np.abs(x) - front, y) + 0.0 * z

            def is_back(x: Array, y: Array, z: Array) -> Array:
                return -np.maximum(np.abs(x) - front, y) + 0.0 * z

            reach = slope * self.half[1] + 12
            ends = ((-400.0, -400.0, z0 - reach), (400.0, 400.0, z0 + reach))
            self.bony(f"rib_{index + 1}", clipped(rib, is_back), ends)
            if index < 9:
                self.add("cartilage", "costal_cartilages", clipped(rib, is_front), calcified, ends)
        at = (0.0, -self.cage[1] - 1.0, 40.0)
        self.bony("sternum", ellipsoid(at=at, axes=(18.0, 6.5, 85.0)), box(at, at, 92), marrow=120.0)
        y = self.spine_y
        for level in range(-9, 10):
            z = 26.0 * level
            body = clipped(ellipse(at=(0.0, y), axes=(20.0, 16.0)), lambda x, _, w, z=z: np.abs(w - z) - 10.5 + 0.0 * x)
            self.bony(f"vertebra_{level}", body, ((-30.0, y - 30, z - 16), (30.0, y + 30, z + 16)))
            for ends in (
                ((-12.0, y + 10, z), (-12.0, y + 26, z)), ((12.0, y + 10, z), (12.0, y + 26, z)),
                ((0.0, y + 28, z), (0.0, min(y + 46, self.half[1] - 6), z - 12)), ((-10.0, y + 22, z), (-34.0, y + 28, z)),
                ((10.0, y + 22, z), (34.0, y + 28, z)),
            ):  # fmt: skip
                self.add("bone", f"vertebra_{level}", capsule(a=ends[0], b=ends[1], r=4.0), 500.0, box(*ends, 9))
        for side in (-1.0, 1.0):
            ends = ((side * 14.0, -self.cage[1] + 6, 128.0), (side * 120.0, -30.0, 165.0))
            self.bony(f"clavicula_{'left' if side > 0 else 'right'}", capsule(a=ends[0], b=ends[1], r=6.0), box(*ends, 10))


def scan(number: int, *, spacing: tuple[float, float, float] = (1.6, 1.6, 2.5)) -> Chest:
    """The chest of that number, scanned: coverage by a ramp, blur, noise, and a circle for some."""
    drawn = Drawing(number)
    random = drawn.random
    a, b = drawn.half
    wide = a + (110.0 if drawn.arms else 40.0)
    deep = (b + 12.0, b + 45.0)
    heights = (-130.0 - 20.0 * (number % 4 == 2), 125.0 + 20.0 * (number % 4 == 2))
    size = [int(np.ceil(v)) for v in (2 * wide / spacing[0], sum(deep) / spacing[1], np.ptp(heights) / spacing[2])]
    first = np.array([-wide, -deep[0], heights[0]])
    x = (first[0] + spacing[0] * np.arange(size[0])).astype(np.float32)
    y = (first[1] + spacing[1] * np.arange(size[1])).astype(np.float32)
    hu = np.empty(size[::-1], np.int16)
    truth = np.zeros(size[::-1], np.uint8)
    names = sorted({name for _, name, _ in drawn.solids})
    which = np.zeros(size[::-1], np.uint8)
    noise = float(random.uniform(8, 22))
    for k in range(size[2]):
        z = np.float32(first[2] + spacing[2] * k)
        image = np.full((size[1], size[0]), -1000.0, np.float32)
        for tissue, name, solid in drawn.solids:
            if not solid.low[2] - spacing[2] <= z <= solid.high[2] + spacing[2]:
                continue
            i = np.flatnonzero((x >= solid.low[0]) & (x <= solid.high[0]))
            j = np.flatnonzero((y >= solid.low[1]) & (y <= solid.high[1]))
            if not len(i) or not len(j):
                continue
            window = np.s_[j[0] : j[-1] + 1, i[0] : i[-1] + 1]
            cover = 0.0
            # Half of the slice's thickness at each of two heights.
            for part in (-0.25, 0.25):
                beyond = solid.distance(x[i][None, :], y[j][:, None], np.float32(z + part * spacing[2]))
                cover = cover + 0.5 * np.clip(0.5 - beyond / spacing[0], 0.0, 1.0)
            image[window] += cover * (solid.hu - image[window])
            there = np.broadcast_to(cover >= 0.5, image[window].shape)
            truth[k][window][there] = LABEL[tissue]
            which[k][window][there] = names.index(name) + 1
        image = ndimage.gaussian_filter(image, 0.7 / spacing[0], mode="nearest")
        image += noise * random.standard_normal(image.shape, np.float32)
        hu[k] = np.clip(np.rint(image), -1024, 3071).astype(np.int16)
    named = {name: which == index + 1 for index, name in enumerate(names)}
    chest = Chest(hu, truth, spacing, first, drawn.nodules, drawn.words, drawn.half, named=named)
    if number % 4 == 3:
        cut(chest, drawn, x, y)
    return chest


def cut(chest: Chest, drawn: Drawing, x: Array, y: Array) -> None:
    """A reconstruction circle that does not hold the whole body, and what stands outside it."""
    a, b = drawn.half
    middle = (drawn.uniform(-20, 20), drawn.uniform(-15, 15))
    radius = drawn.uniform(max(0.8 * a, b + 4), 0.95 * a)
    padding = (-1000, -1024, -2000, -3024)[drawn.number // 4 % 4]
    outside = np.hypot(x[None, :] - middle[0], y[:, None] - middle[1]) > radius
    chest.hu[:, outside] = padding
    chest.circle = (*middle, radius)
    chest.words.append(f"circle of {2 * radius:.0f} mm, {padding} outside")

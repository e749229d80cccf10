"""A needle that cuts its path through tissue, a second time: another discretisation, and contact with a stiff wall.

The beam is a system of first order, `v' = t, t' = m, m' = s, s' = -k (v - c) / EI`, in the box scheme (midpoints of
intervals), with the whole system solved anew for every depth of the tip. Both planes are the same, so a case lies in
the plane in which the tip is pushed. Two nested grids are extrapolated (Richardson). In the guide's bore the needle
is a beam of cubics whose nodes keep within a stiff round wall, found by Newton's method. No code,
closed form or element of needlebench is in here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

STEEL_PA = 200e9
# Nominal outer diameters by gauge, m.
OUTER_M = {16: 1.651e-3, 17: 1.473e-3, 18: 1.270e-3, 19: 1.067e-3, 20: 0.908e-3, 21: 0.819e-3, 22: 0.718e-3}
# The first interval in tissue, and how much each one is longer than the one before.
FIRST_M, GROWTH = 1e-7, 1.1
BORE_NODES = 49
# A wall that gives way by less than 10 nm, and when a balance is found.
WALL_N_M, STILL_M, STILL_N = 1e9, 1e-9, 1e-9


@dataclass
class Case:
    """Of layers `(length_m, k_n_m2, force_n)`; held by `guide` (length_m, play_m), `hub` (length_m) or a clamp."""

    outer_m: float
    layers: list[tuple[float, float, float]]
    bevel_rad: float = math.radians(25)
    turn_m: float | None = None
    standoff_m: float = 0.0
    guide: tuple[float, float] | None = None
    hub_m: float | None = None
    slip: tuple[float, tuple[float, float]] | None = None

    @property
    def ei(self) -> float:
        return STEEL_PA * math.pi / 64 * self.outer_m**4

    @property
    def depth_m(self) -> float:
        return sum(length for length, _, _ in self.layers)

    def force(self, depth_m: float) -> float:
        """The mean over the face of the bevel; what is outside the skin bears none."""
        face_m = self.outer_m / math.tan(self.bevel_rad)
        edges, begin = [], 0.0
        for length, _, force in self.layers:
            edges.append((begin, begin + length, force))
            begin += length
        if self.turn_m is not None:
            cut = []
            for a, b, force in edges:
                middle = min(max(self.turn_m, a), b)
                cut += [(a, middle, force), (middle, b, -force)]
            edges = cut
        inside = (max(0.0, min(b, depth_m) - max(a, depth_m - face_m)) * force for a, b, force in edges)
        return sum(inside) / face_m


def grid(case: Case, interval_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Depths of nodes, and the stiffness of each interval."""
    nodes, stiffness, begin = [0.0], [], 0.0
    marks = [case.turn_m] if case.turn_m is not None else []
    marks += [case.slip[0]] if case.slip else []
    for length, k, _ in case.layers:
        end = begin + length
        start = begin
        if k > 0:
            step = FIRST_M
            while step < interval_m and start + step < end:
                start += step
                nodes.append(start)
                stiffness.append(k)
                step *= GROWTH
        ends = [start, *sorted(mark for mark in marks if start + 1e-9 < mark < end - 1e-9), end]
        for a, b in zip(ends, ends[1:], strict=False):
            count = max(4, math.ceil((b - a) / interval_m - 1e-9))
            nodes += list(a + (b - a) * np.arange(1, count + 1) / count)
            stiffness += [k] * count
        begin = end
    return np.array(nodes), np.array(stiffness)


def halved(nodes: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    fine = np.empty(2 * len(nodes) - 1)
    fine[::2], fine[1::2] = nodes, 0.5 * (nodes[1:] + nodes[:-1])
    return fine, np.repeat(stiffness, 2)


class Outside:
    """The needle from the exit to the tip at a node: banded equations of the box scheme."""

    BELOW, ABOVE = 5, 3

    def __init__(self, case: Case, nodes: np.ndarray, stiffness: np.ndarray):
        self.case, self.k, self.h = case, stiffness / case.ei, np.diff(nodes)
        self.nodes = nodes
        size = 4 * (len(nodes) + 1)
        self.full = np.zeros((self.BELOW + self.ABOVE + 1, size))
        # Unknowns of a node: v, t, m, s. Equations: two at the exit, four of each interval, two at the tip.
        self._set(0, 0, 1.0)
        self._set(1, 1, 1.0)
        for at, (h, k) in enumerate(zip(self.h, self.k, strict=True), start=1):
            row, left, right = 4 * at + 2, 4 * at, 4 * at + 4
            for part in range(3):
                self._set(row + part, left + part, -1.0)
                self._set(row + part, right + part, 1.0)
                self._set(row + part, left + part + 1, -0.5 * h)
                self._set(row + part, right + part + 1, -0.5 * h)
            self._set(row + 3, left + 3, -1.0)
            self._set(row + 3, right + 3, 1.0)
            self._set(row + 3, left, 0.5 * k * h)
            self._set(row + 3, right, 0.5 * k * h)

    def _set(self, row: int, column: int, value: float, bands: np.ndarray | None = None) -> None:
        (self.full if bands is None else bands)[self.ABOVE + row - column, column] = value

    def solve(self, tip: int, force: float, loads: list[np.ndarray], cuts: bool = True) -> np.ndarray:
        """States with the tip at a node: for each plane's load of the intervals, and for v = 1 and t = 1 at the exit.

        `loads` is the mean of the path at both ends of each interval, without the tip's own where it cuts.
        """
        case = self.case
        free_m = case.standoff_m if case.hub_m is None else case.hub_m - self.nodes[tip]
        size = 4 * (tip + 2)
        bands = self.full[:, :size].copy()
        # From the exit to the skin: exact, as nothing is there.
        for part in range(4):
            self._set(2 + part, 4 + part, 1.0, bands)
            for more in range(part, 4):
                self._set(2 + part, more, -(free_m ** (more - part)) / math.factorial(more - part), bands)
        if cuts:
            # The tip's end of the last interval rests on the tip itself.
            self._set(size - 3, size - 4, 0.0, bands)
        # The tip's two equations, where those of the next interval would be.
        for row in (size - 2, size - 1):
            for column in range(size - 4, size):
                self._set(row, column, float(row == column), bands)
        right = np.zeros((size, len(loads) + 2))
        for plane, load in enumerate(loads):
            right[9 : 4 * tip + 6 : 4, plane] = (self.k * self.h * load)[:tip]
        right[size - 1, 0] = -force / case.ei
        right[0, -2] = right[1, -1] = 1.0
        return solve_banded((self.BELOW, self.ABOVE), bands, right, check_finite=False)

    def ends(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What holds the exit, by each plane's load, by v = 1 and t = 1: the force EI v''', the moment -EI v''."""
        both = self.case.ei * np.stack([states[3], -states[2]])
        return both[:, :-2].T, both[:, -2:]

    def loads(self, path: np.ndarray, tip: int) -> np.ndarray:
        ends = path[: tip + 1].copy()
        ends[tip] = 0.0
        load = np.zeros(len(self.h))
        load[:tip] = 0.5 * (ends[:-1] + ends[1:])
        return load


class Bore:
    """A beam of cubics between two walls; its last node is the exit."""

    def __init__(self, ei: float, length_m: float, play_m: float):
        count = BORE_NODES
        h = length_m / (count - 1)
        self.length_m = length_m
        one = (
            ei
            / h**3
            * np.array(
                [
                    [12, 6 * h, -12, 6 * h],
                    [6 * h, 4 * h * h, -6 * h, 2 * h * h],
                    [-12, -6 * h, 12, -6 * h],
                    [6 * h, 2 * h * h, -6 * h, 4 * h * h],
                ]
            )
        )
        self.stiffness = np.zeros((2 * count, 2 * count))
        for at in range(count - 1):
            self.stiffness[2 * at : 2 * at + 4, 2 * at : 2 * at + 4] += one
        self.play_m = play_m
        self.places = np.arange(0, 2 * count, 2)
        self.last = None

    def seat(self, gradients: np.ndarray, more: np.ndarray) -> np.ndarray:
        """Displacement and slope at the exit, a row for each plane, where the energy is least.

        That of what is outside is gradient . q + q . more . q / 2 in each plane. Newton's method, with a line search,
        on a round wall that is stiff beyond the play.
        """
        planes, size = len(gradients), len(self.stiffness)
        matrix = self.stiffness.copy()
        matrix[-2:, -2:] += more
        load = np.zeros((planes, size))
        load[:, -2:] = -gradients

        def out(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            radius = np.sqrt((at[:, self.places] ** 2).sum(axis=0))
            return radius, np.maximum(radius - self.play_m, 0.0)

        def energy(at: np.ndarray) -> float:
            return (at * (0.5 * at @ matrix - load)).sum() + 0.5 * WALL_N_M * (out(at)[1] ** 2).sum()

        found = self.last
        if found is None or found.shape != load.shape:
            # Straight, and on the walls at both ends.
            towards = -gradients[:, :1] / np.linalg.norm(gradients[:, 0])
            found = np.zeros((planes, size))
            found[:, self.places] = towards * np.linspace(-1, 1, len(self.places)) * self.play_m * (1 + 1e-9)
            found[:, 1::2] = towards * 2 * self.play_m / self.length_m
        whole = np.kron(np.eye(planes), matrix)
        for _ in range(1000):
            radius, through = out(found)
            slope = found @ matrix - load
            hessian = whole.copy()
            for index in np.nonzero(through)[0]:
                place = self.places[index]
                normal = found[:, place] / radius[index]
                slope[:, place] += WALL_N_M * through[index] * normal
                across = np.outer(normal, normal)
                bent = across + through[index] / radius[index] * (np.eye(planes) - across)
                dofs = place + size * np.arange(planes)
                hessian[np.ix_(dofs, dofs)] += WALL_N_M * bent
            out_of_balance = np.abs(slope[:, self.places]).max()
            step = -np.linalg.solve(hessian, slope.ravel()).reshape(found.shape)
            share, now, falls = 1.0, energy(found), (slope * step).sum()
            while share > 1e-6 and energy(found + share * step) > now + 1e-4 * share * falls:
                share *= 0.5
            found = found + share * step
            if np.abs(step[:, self.places]).max() < STILL_M or out_of_balance < STILL_N:
                self.last = found
                return found[:, -2:]
        raise RuntimeError(f"the bore has no balance: {np.abs(step[:, self.places]).max()} m")


@dataclass
class Done:
    nodes: np.ndarray
    path: np.ndarray
    tip: np.ndarray


def once(case: Case, nodes: np.ndarray, stiffness: np.ndarray) -> Done:
    outside = Outside(case, nodes, stiffness)
    bore = Bore(case.ei, *case.guide) if case.guide else None
    path = np.zeros(len(nodes))
    sign = next((math.copysign(1, force) for _, _, force in case.layers if force), 0)
    if case.guide:
        # A straight needle on both ends of the bore.
        length_m, play_m = case.guide
        path[0] = sign * play_m * (1 + 2 * case.standoff_m / length_m)

    for tip in range(1, len(nodes)):
        force = case.force(nodes[tip])
        held = (stiffness[:tip] > 0).any()
        if bore and not held and force == 0:
            continue
        states = outside.solve(tip, force, [outside.loads(path, tip)])
        at_tip = states[-4]
        path[tip] = at_tip[0]
        if bore:
            path[tip] += (bore.seat(*outside.ends(states)) @ at_tip[1:])[0]
    tip = len(nodes) - 1
    ends = np.array([path[-1], 0.0])
    if case.slip:
        from_m, by = case.slip
        moved = (0.5 * (nodes[1:] + nodes[:-1]) > from_m).astype(float)
        # The tip's own rest point is its place in the path, which has moved with the tissue.
        rest = 0.5 * (path[1:] + path[:-1])
        loads = [rest + by[0] * moved, by[1] * moved]
        ends = slipped(case, outside, bore, tip, loads)
    return Done(nodes, path, ends)


def slipped(case: Case, outside: Outside, bore: Bore | None, tip: int, loads: list[np.ndarray]) -> np.ndarray:
    """Nothing is cut any more: the tip's end of the last interval is a spring as any other."""
    states = outside.solve(tip, case.force(outside.nodes[tip]), loads, cuts=False)
    at_tip = states[-4]
    found = at_tip[:2].copy()
    if bore:
        found += bore.seat(*outside.ends(states)) @ at_tip[-2:]
    return found


def inserted(case: Case, interval_m: float = 0.4e-3) -> tuple[Done, float]:
    """Extrapolated, and how far the two grids are apart at the tip."""
    nodes, stiffness = grid(case, interval_m)
    coarse = once(case, nodes, stiffness)
    fine = once(case, *halved(nodes, stiffness))
    path = fine.path[::2] + (fine.path[::2] - coarse.path) / 3
    tip = fine.tip + (fine.tip - coarse.tip) / 3
    return Done(nodes, path, tip), float(np.abs(fine.tip - coarse.tip).max())

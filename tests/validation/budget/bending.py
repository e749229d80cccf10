"""A needle that cuts its path through layers, for all draws at once, by NumPy alone.

`EI v'''' + k (v - c) = 0` from the guide's exit to the tip, where `EI v'' = 0` and the shear is the force across it;
the path grows by the tip's own displacement, `c(L) = v(L)`. Shooting: what is cut stays as it is, so each state
(displacement, slope, and the second and third derivative) is a linear function of that at the exit, and one further
interval is one product with its transfer matrix. The equation is solved exactly within an interval, over which the
path is straight. Draws are the last axis of arrays; one plane, displacements positive to where the tip is pushed
first. SI units.
"""

from __future__ import annotations

import math

import numpy as np
from model import defaults

Array = np.ndarray

# Needles in patients that are drawn, and how many are solved at a time.
BENDS, AT_ONCE = 40_000, 4_000
YOUNG_SPREAD = 0.05
# By tissue, as in the guide: the median stiffness that its force is of, and by which factor (a lognormal's standard
# deviation) stiffness and share of the force are spread. The wall's share has no spread but that of the force.
TISSUES = {
    "fat": (5e3, 1.7, 1.6),
    "wall": (20e3, 1.8, 1.0),
    "lung": (2e3, 2.0, 1.9),
    "lesion": (20e3, 1.8, 1.5),
}
FORCE_BY_STIFFNESS, FORCE_OF_M, MODEL_SPREAD = 0.53, 1.27e-3, 1.25
SHARE_OF_TIP = {"bevel": 1.0, "symmetric": 0.08, "rolled": 0.2}

# Longest interval of the path, the first one of each layer and how much each is longer than the one before.
INTERVAL_M, FIRST_M, GROWTH = 1e-3, 2e-5, 1.5
# Terms of the series of an interval: the next is (k h^4 / EI)^3 / 12!, which is below rounding.
TERMS = 2
# Halvings of the play where the exit leans on neither wall, and how far from the wall that begins, as a share.
HALVINGS, OFF_THE_WALL = 30, 1e-9


def transfer(kappa: Array, h: float) -> Array:
    """What a free beam on a foundation `kappa = k / EI` does to its state over `h` (4, 4, draws)."""
    phi = []
    for i in range(4):
        term = np.full_like(kappa, h**i / math.factorial(i))
        total = term
        for j in range(4, 4 * TERMS + 1, 4):
            term = term * (-kappa * h**4) * (math.factorial(i + j - 4) / math.factorial(i + j))
            total = total + term
        phi.append(total)
    rows = [[phi[j - i] if j >= i else -kappa * phi[4 + j - i] for j in range(4)] for i in range(4)]
    return np.array(rows)


def nodes_of(lengths: list[float], turn_m: float | None) -> list[tuple[int, float]]:
    """Layer and end of each interval, from the skin on."""
    found, begin = [], 0.0
    for layer, length in enumerate(lengths):
        at, step = begin, FIRST_M
        marks = [begin + length] if turn_m is None else sorted({begin + length, turn_m})
        for mark in (mark for mark in marks if begin < mark <= begin + length):
            while at < mark:
                # The last two share what is left, and rounding is no interval.
                left = mark - at
                at = mark if left < 1.01 * step else at + (0.5 * left if left < 2.0 * step else step)
                found.append((layer, at))
                step = min(GROWTH * step, INTERVAL_M)
        begin += length
    return found


def seat(ei: Array, free: Array, by: Array, length_m: float, play_m: float) -> Array:
    """Displacement and slope at the exit of a bore (2, draws).

    The needle outside has `v'', v''' = free + by (v, v')` there. In the bore it is straight, or leans on the wall at
    the entry, or lies on that wall up to a distance from the exit: where it leaves the wall it has neither slope nor
    moment, so it is a cubic from there. The exit may be anywhere within the play, and walls only push. Without play
    they clamp it.
    """
    if play_m == 0.0:
        return np.zeros_like(free)

    def lean(v: Array, of: Array | slice = slice(None)) -> tuple[Array, Array]:
        """Slope, and the force that holds the exit at `v`, of some draws."""
        stiff, pulls, follows = ei[of], free[:, of], by[..., of]
        moment, resists = stiff * (pulls[0] + follows[0, 0] * v), -stiff * follows[0, 1]
        above, below = (play_m + v) / length_m, (play_m - v) / length_m
        sign = np.where(moment > resists * above, 1.0, np.where(-moment > resists * below, -1.0, 0.0))
        # How far the exit is off the wall that the needle leans on behind it.
        off = play_m + np.where(sign < 0.0, -v, v)
        bends = np.abs(moment)
        leans = (bends + 3.0 * stiff * off / length_m**2) / (resists + 3.0 * stiff / length_m)
        lies = 2.0 * bends / (resists + np.sqrt(resists**2 + 8.0 / 3.0 * stiff * bends / off))
        bent = np.where(leans > 3.0 * off / length_m, lies, leans)
        slope = np.where(sign == 0.0, moment / resists, sign * bent)
        span = np.where(sign == 0.0, length_m, np.minimum(length_m, 3.0 * off / bent))
        inside = np.where(sign == 0.0, 0.0, moment - resists * slope) / span
        return slope, stiff * (pulls[1] + follows[1, 0] * v + follows[1, 1] * slope) - inside

    most = play_m * (1.0 - OFF_THE_WALL)
    place = np.full_like(ei, most)
    place[lean(place)[1] > 0.0] = -most
    between = np.nonzero((place < 0.0) & (lean(place)[1] < 0.0))[0]
    if len(between):
        low, high = np.full(len(between), -most), np.full(len(between), most)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            pulled = lean(middle, between)[1] > 0.0
            low, high = np.where(pulled, low, middle), np.where(pulled, middle, high)
        place[between] = high
    return np.array([place, lean(place)[0]])


def inserted(
    ei: Array,
    layers: list[tuple[float, Array, Array]],
    face_m: float,
    held: tuple[float, float, float],
    turn_m: float | None = None,
) -> Array:
    """The path at the skin and at the tip (2, draws).

    Of layers (length, stiffness, force across the tip) and `held` (the guide's length and stand-off, and the play to
    each side). The force is the mean over the bevel's face behind the tip; a turn reverses it.
    """
    length_m, standoff_m, play_m = held
    edges, begin = [], 0.0
    for length, _, force in layers:
        middle = begin + length if turn_m is None else min(max(turn_m, begin), begin + length)
        edges += [(begin, middle, force), (middle, begin + length, -force)]
        begin += length
    state = transfer(np.zeros_like(ei), standoff_m)
    rest = np.zeros((4, len(ei)))
    # Straight, and on the walls at both ends.
    path = np.full_like(ei, play_m * (1.0 + 2.0 * standoff_m / length_m))
    skin, at = path, 0.0
    steps: dict[tuple[int, float], Array] = {}
    for layer, end in nodes_of([length for length, _, _ in layers], turn_m):
        force = sum(max(0.0, min(b, end) - max(a, end - face_m)) * of for a, b, of in edges) / face_m
        # Most intervals of a layer are alike.
        alike = (layer, round(end - at, 9))
        if alike not in steps:
            steps[alike] = transfer(layers[layer][1] / ei, end - at)
        step = steps[alike]
        state = np.einsum("ijn,jkn->ikn", step, state)
        rest = np.einsum("ijn,jn->in", step, rest) - step[:, 0] * path
        # The path's slope over the interval is what brings its end to the needle's: of the two equations at the tip it
        # takes a share.
        share = step[2:, 1] / step[0, 1]
        two = state[2:] - share[:, None] * state[0]
        right = np.array([np.zeros_like(ei), -force / ei]) - rest[2:] + share * rest[0]
        (a, b), (c, d) = two[:, 2:]
        inverse = np.array([[d, -b], [-c, a]]) / (a * d - b * c)
        free = np.einsum("ijn,jn->in", inverse, right)
        by = -np.einsum("ijn,jkn->ikn", inverse, two[:, :2])
        exit_ = seat(ei, free, by, length_m, play_m)
        whole = np.concatenate([exit_, free + np.einsum("ijn,jn->in", by, exit_)])
        slope = ((state[0] * whole).sum(axis=0) + rest[0]) / step[0, 1]
        path = path + (end - at) * slope
        rest = rest - step[:, 1] * slope
        rest[0] += path
        rest[1] += slope
        at = end
    return np.array([skin, path])


def best_turn(
    block: dict, layers: list[tuple[str, float]], outer_m: float, held: tuple[float, float, float]
) -> tuple[float, float]:
    """Root mean square bends of the turn that was chosen, and of the best of all twentieths of the way."""
    depth_mm = 1e3 * sum(length for _, length in layers)

    def rms(at_mm: float) -> float:
        turned = block | {"turn_at_mm": at_mm}
        _, tip = bends(turned, layers, outer_m, held, np.random.default_rng(29), AT_ONCE)
        return float(np.sqrt((tip**2).mean()))

    return rms(block["turn_at_mm"]), min(rms(depth_mm * step / 20) for step in range(2, 20))


def bends(
    block: dict,
    layers: list[tuple[str, float]],
    outer_m: float,
    held: tuple[float, float, float],
    random: np.random.Generator,
    count: int | None = None,
) -> Array:
    """Where needles pierce the skin and where they end, towards where the tip is pushed: one patient each (2, draws).

    `[imperfections.needle]` says what is uncertain, with its medians; of layers (tissue, length) and `held` as of
    `inserted`. Stiff tissue pushes harder, and the model is a factor on where the tip ends.
    """
    assert "measured" not in block, "no model of its own for a measured force"
    count = count or BENDS
    stiffness = defaults("StiffnessBlock", block.get("stiffness", {}))
    forces = defaults("ForcesBlock", block.get("forces", {})) | {"wall_share": 1.0}

    def factor(spread: float) -> Array:
        return spread ** random.standard_normal(count)

    inner_m = 1e-3 * block["bore_mm"]
    young = 1e9 * block["young_gpa"] * (1.0 + YOUNG_SPREAD * random.standard_normal(count))
    ei = young * np.pi / 64.0 * (outer_m**4 - inner_m**4)
    wall_n = forces["wall_n"] * factor(forces["wall_spread"]) * forces["living"] * outer_m / FORCE_OF_M
    drawn = {"fluid": (np.zeros(count), np.zeros(count)), "gas": (np.zeros(count), np.zeros(count))}
    for tissue, (median, stiffness_spread, share_spread) in TISSUES.items():
        k = 1e3 * stiffness[f"{tissue}_kn_m2"] * factor(stiffness_spread)
        share = forces[f"{tissue}_share"] * factor(share_spread)
        drawn[tissue] = (k, wall_n * SHARE_OF_TIP[block["tip"]] * share * (k / median) ** FORCE_BY_STIFFNESS)
    turn_mm = block.get("turn_at_mm")
    face_m = outer_m / math.tan(math.radians(block["bevel_deg"]))
    found = []
    for some in np.split(np.arange(count), count // AT_ONCE):
        now = [(length, drawn[tissue][0][some], drawn[tissue][1][some]) for tissue, length in layers]
        found.append(inserted(ei[some], now, face_m, held, None if turn_mm is None else 1e-3 * turn_mm))
    skin, tip = np.concatenate(found, axis=1)
    return np.array([skin, tip * factor(MODEL_SPREAD)])

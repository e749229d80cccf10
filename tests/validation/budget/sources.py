"""What makes an arm and a patient differ from the plan: each source is one function.

A source draws what it is of (`Truth`), as README and schema of the scenario describe it. What follows from
it - where the arm comes to rest, where the needle and the target are - is `errors`.
"""

import pickle
from dataclasses import dataclass, field

import bending
import numpy as np
from model import (
    GRAVITY_M_S2,
    Arm,
    Array,
    Chain,
    defaults,
    flange,
    from_vector,
    gravity_torque,
    mass_matrix,
    moved,
    posture,
)

# Fixed-point steps of the balance of torques: each contracts by what a radian changes the weight's torque by, over
# the stiffness: 1e-2.
BALANCE_STEPS = 4
# Steps of a weighted fit from the unweighted one: each leaves a hundredth, since turns are of some milliradians.
FIT_STEPS = 6
# Halvings of the way that a joint springs back: a way of a milliradian to rounding.
HALVINGS = 50
# Postures that a calibration is made from, and what a radian of the flange counts beside a metre.
ABSORBING_POSTURES = 200
CALIBRATIONS = 20_000
# Points of the lattice that their postures are picked from, and its generator.
LATTICE = (32_749, 7_919)
# Calibrations that are solved at a time.
AT_ONCE = 500
LEVER_M = 0.2


@dataclass(frozen=True)
class Case:
    """One configuration of one goal."""

    arm: Arm
    target: Array  # joint positions that the controller holds
    depths: tuple[
        float, float
    ]  # of the needle beyond the guide at the skin and at the target
    axes: Array  # rows: across the needle towards the head, across, along
    phantom_turn: Array
    phantom_place: Array
    real_arms: Array  # deviations: arms, joints, 6
    times: Array  # of the planned motion's last phase
    path: Array  # joint positions at these times
    timestep: float
    blocks: dict  # [imperfections], by name
    layers: list[tuple[str, float]] = field(default_factory=list)  # tissue and length, from the skin on
    pushed_towards: Array | None = None  # of a bevel of known direction: along the first two axes
    aim: Array = field(default_factory=lambda: np.zeros(3))  # of the axis beside the target, along all three


@dataclass
class Truth:
    """Rows of arms and patients; what no source touches is as planned."""

    count: int
    chain: Chain
    tool_mass: Array
    tool_com: Array
    softness: Array  # factor on each gear's twist; no gears if all are 0
    reading: Array  # of the encoders at rest, beyond the motor's angle
    noise: Array | None = None  # standard deviation of a reading
    friction: dict | None = (
        None  # with the factor of the true friction on the believed one
    )
    in_guide: Array = field(
        default_factory=lambda: np.zeros((1, 2, 2))
    )  # needle at entry and exit
    shift_turn: Array = field(
        default_factory=lambda: np.eye(3)[None]
    )  # true place on planned one
    shift_place: Array = field(default_factory=lambda: np.zeros((1, 3)))
    breath: Array = field(
        default_factory=lambda: np.zeros((2, 1, 3))
    )  # of skin and target
    deviations: Array = field(
        default_factory=lambda: np.zeros((1, 6, 6))
    )  # of joint origins
    markers: Array | None = None
    weights: Array | None = None  # inverse of each marker's covariance; none: all alike
    seen_off: Array | float = 0.0  # of each marker, phantom frame
    base_turn: Array = field(default_factory=lambda: np.eye(3)[None])
    base_place: Array = field(default_factory=lambda: np.zeros((1, 3)))
    unseen: Array = field(
        default_factory=lambda: np.zeros((1, 3))
    )  # target, phantom frame
    bent: Array = field(default_factory=lambda: np.zeros((2, 1, 3)))  # needle, axes
    pushed: Array = field(default_factory=lambda: np.zeros((2, 1)))  # along the needle


def as_planned(case: Case, count: int) -> Truth:
    """The nominal arm and patient."""
    body = case.arm.tool.body
    zero = np.zeros((1, 6))
    return Truth(
        count, case.arm.chain, np.array([body.mass]), body.com[None], zero, zero
    )


def calibration(
    case: Case, block: dict, random: np.random.Generator, truth: Truth
) -> None:
    """An arm of the normal distribution with mean and covariance of the real arms."""
    arms = case.real_arms.reshape(len(case.real_arms), -1) * block["scale"]
    middle = arms.mean(axis=0)
    if block.get("class", "factory_calibrated") != "nominal_kinematics":
        # The controller knows its arm, but for a share.
        arms, middle = arms * block["residual"], 0.0 * middle
    spread = np.cov(arms, rowvar=False)
    drawn = random.multivariate_normal(middle, spread, truth.count, method="eigh")
    truth.deviations = truth.deviations + drawn.reshape(-1, 6, 6)


def encoder(case: Case, block: dict, random: np.random.Generator, truth: Truth) -> None:
    """Zero, rounding and noise of the encoders."""
    resolution, noise, zeros = (
        np.radians(block[key])
        for key in ("resolution_deg", "noise_deg", "zero_spread_deg")
    )
    rounding = resolution * random.uniform(-0.5, 0.5, (truth.count, 6))
    truth.reading = zeros * random.standard_normal((truth.count, 6)) + rounding
    truth.noise = noise


def elasticity(
    case: Case, block: dict, random: np.random.Generator, truth: Truth
) -> None:
    """Gears that twist by the torque that they carry, less what a calibration took of it for geometry."""
    truth.softness = 1.0 + block["spread"] * random.standard_normal((truth.count, 6))
    calibrated = case.blocks.get("calibration")
    if calibrated is not None and calibrated.get("measured_under_gravity", True):
        assert calibrated.get("class") != "calibrated_here", "the tool was on then"
        # Whose postures nobody knows: each arm has one of many calibrations.
        taken = calibrations(case)[random.integers(0, CALIBRATIONS, truth.count)]
        truth.deviations = truth.deviations - np.einsum(
            "nj,njik->nik", truth.softness, taken
        )


def twist(case: Case, torque: Array) -> Array:
    """Angle of each gear under a torque: three slopes, stiffer from corner to corner."""
    gears = case.arm.data["gears"]
    given = case.blocks["elasticity"].get("stiffness_nm_rad")
    more = gears.get("stiffening")
    if given is not None or more is None:
        return torque / np.array(given or gears["stiffness_nm_rad"])
    corners = [np.zeros(6), *(np.array(more[k]) for k in ("first_corner_nm", "second_corner_nm")), np.inf]
    slopes = [gears["stiffness_nm_rad"], more["second_nm_rad"], more["third_nm_rad"]]
    size = np.abs(torque)
    parts = [
        np.clip(size, low, high) - low
        for low, high in zip(corners[:-1], corners[1:], strict=True)
    ]
    return np.sign(torque) * sum(
        part / np.array(slope) for part, slope in zip(parts, slopes, strict=True)
    )


def softest_loop(case: Case) -> Array:
    """Least compliance of the gears, which the servo's small motions are reckoned with."""
    if "elasticity" not in case.blocks:
        return np.zeros(6)
    large = np.full(6, 1e6)
    return (twist(case, 2.0 * large) - twist(case, large)) / large


def even_postures(random: np.random.Generator) -> Array:
    """Joint positions in (-pi, pi) by a lattice of Korobov's, shifted at random."""
    count, generator = LATTICE
    steps = np.array([pow(generator, k, count) for k in range(6)])
    share = np.arange(count)[:, None] * steps % count / count + random.random(6)
    return (2.0 * (share % 1.0) - 1.0) * np.pi


def what_postures_tell(case: Case, q: Array) -> tuple[Array, Array]:
    """Of the postures with the flange above the base: what origin deviations (36) and the sag of each joint (6) do there
    to a bare, upright arm's place and to 0.2 m of its orientation (6). By differences of the forward kinematics.
    """
    arm = Arm(
        case.arm.chain, case.arm.bodies, np.eye(3), np.zeros(3), case.arm.tool, case.arm.data
    )

    def pose(chain: Chain, q: Array) -> tuple[Array, Array]:
        turn, place = flange(chain, posture(arm, chain, q))
        return np.broadcast_to(turn, (len(q), 3, 3)), np.broadcast_to(place, (len(q), 3))

    def change(ahead: tuple[Array, Array], behind: tuple[Array, Array]) -> Array:
        turn = (ahead[0] @ behind[0].transpose(0, 2, 1)) / (2.0 * step)
        vector = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=-1)
        place = (ahead[1] - behind[1]) / (2.0 * step)
        return np.hstack([place, LEVER_M * vector])

    step = 1e-5
    q = q[pose(arm.chain, q)[1][:, 2] >= 0.0]
    moves = []
    for joint in range(6):
        for k in range(6):
            off = np.zeros((1, 6, 6))
            off[0, joint, k] = step
            moves.append(change(*(pose(moved(arm.chain, sign * off), q) for sign in (1.0, -1.0))))
    bare = gravity_torque(arm, arm.chain, q, np.zeros(1), np.zeros((1, 3)))
    angle = twist(case, bare)
    sags = []
    for joint in range(6):
        off = np.zeros(6)
        off[joint] = step
        swing = change(pose(arm.chain, q + off), pose(arm.chain, q - off))
        sags.append(-swing * angle[:, joint, None])
    return np.stack(moves, axis=-1), np.stack(sags, axis=-1)


def calibrations(case: Case) -> Array:
    """Origin deviations (by calibration and by sagging joint) that fit best what the twists do, each over 200 postures of
    its own: least squares, and the smallest that fit.
    """
    of = pickle.dumps((case.arm.chain, case.arm.bodies, case.arm.data, case.blocks["elasticity"]))
    if of not in KNOWN_CALIBRATIONS:
        random = np.random.default_rng(17)
        moves, sags = what_postures_tell(case, even_postures(random))
        both = np.concatenate([moves, sags], axis=-1)
        # Of each posture, what the normal equations are sums of.
        products = np.einsum("nri,nrj->nij", moves, both).reshape(len(moves), -1)
        found = []
        for _ in range(CALIBRATIONS // AT_ONCE):
            picked = random.multinomial(ABSORBING_POSTURES, np.full(len(moves), 1.0 / len(moves)), AT_ONCE)
            sums = (picked @ products).reshape(AT_ONCE, 36, 42)
            inverse = np.linalg.pinv(sums[..., :36], rcond=1e-9, hermitian=True)
            solved = inverse @ sums[..., 36:]
            found.append(solved.transpose(0, 2, 1).reshape(AT_ONCE, 6, 6, 6))
        KNOWN_CALIBRATIONS[of] = np.concatenate(found)
    return KNOWN_CALIBRATIONS[of]


# By the arm and its gears: the same for all cases of a scenario.
KNOWN_CALIBRATIONS: dict[bytes, Array] = {}


def payload(case: Case, block: dict, random: np.random.Generator, truth: Truth) -> None:
    """A tool that is heavier than believed, or heavy elsewhere."""
    body = case.arm.tool.body
    error = block["mass_error_kg"] + block["mass_spread_kg"] * random.standard_normal(
        truth.count
    )
    off = np.array(block["com_error_mm"]) + block[
        "com_spread_mm"
    ] * random.standard_normal((truth.count, 3))
    truth.tool_mass = body.mass + error
    truth.tool_com = body.com + off * 1e-3


def friction(
    case: Case, block: dict, random: np.random.Generator, truth: Truth
) -> None:
    """LuGre friction of which the believed part is compensated while the joint moves."""
    own = case.arm.data["friction"]
    values = {
        key: np.array(block.get(key) or own[key]) for key in own if key != "source"
    }
    values["compensation"] = block["compensation"]
    values["factor"] = 1.0 + block["spread"] * random.standard_normal((truth.count, 6))
    truth.friction = values


def clearance_of(case: Case, block: dict) -> float:
    """What the guide's bore is wider than the needle."""
    given = block.get("diametral_clearance_mm")
    return case.arm.tool.bore - case.arm.tool.needle if given is None else given * 1e-3


def guide(case: Case, block: dict, random: np.random.Generator, truth: Truth) -> None:
    """The needle's axis anywhere in a disc at each end of the guide."""
    radius = 0.5 * clearance_of(case, block) * np.sqrt(random.random((truth.count, 2)))
    angle = random.uniform(0.0, 2.0 * np.pi, (truth.count, 2))
    truth.in_guide = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def covariances(given: list) -> Array:
    """Symmetric matrices, m^2, of `[xx, yy, zz, xy, xz, yz]`, mm^2."""
    order = [[0, 3, 4], [3, 1, 5], [4, 5, 2]]
    return np.array(given)[..., order] * 1e-6


def place_markers(block: dict, truth: Truth) -> None:
    """Where the markers are, and how much each counts in the fit."""
    truth.markers = np.array(block["markers_mm"]) * 1e-3
    if "covariance_mm2" in block:
        truth.weights = np.linalg.inv(covariances(block["covariance_mm2"]))


def registration(
    case: Case, block: dict, random: np.random.Generator, truth: Truth
) -> None:
    """Markers seen with an error: the same for all, or as was measured of each."""
    place_markers(block, truth)
    if "covariance_mm2" in block:
        each = [
            random.multivariate_normal(np.zeros(3), covariance, truth.count, method="eigh")
            for covariance in covariances(block["covariance_mm2"])
        ]
        truth.seen_off = truth.seen_off + np.stack(each, axis=1)
        return
    sigma = block["localisation_error_mm"] * 1e-3 / np.sqrt(3.0)
    truth.seen_off = truth.seen_off + sigma * random.standard_normal(
        (truth.count, *truth.markers.shape)
    )


def skin_markers(
    case: Case, block: dict, random: np.random.Generator, truth: Truth
) -> None:
    """Markers that shift on the skin, and rise with it at a phase of their own."""
    place_markers(defaults("RegistrationBlock", case.blocks["registration"]), truth)
    shift = block["shift_mm"] * 1e-3 * random.standard_normal((truth.count, *truth.markers.shape))
    breath = defaults("BreathingBlock", case.blocks["breathing"])
    own = breath | {"phase": 0.0, "phase_spread": block["phase_spread"]}
    share = np.sin(np.pi * phases(own, random, truth.count)) ** 4
    risen = share[:, None] * np.array(breath["skin_mm"]) * 1e-3
    truth.seen_off = truth.seen_off + shift + risen[:, None]


def weighted(
    markers: Array, seen: Array, weights: Array, turn: Array, place: Array
) -> tuple[Array, Array]:
    """Least squares of `(turn m + place - seen)` with a weight for each marker, by Gauss and Newton."""
    for _ in range(FIT_STEPS):
        turned = np.einsum("nij,kj->nki", turn, markers)
        left = seen - turned - place[:, None]
        moves = np.zeros((*turned.shape, 6))  # of each marker, by a shift and a small turn
        moves[..., :3] = np.eye(3)
        for axis in range(3):
            moves[..., 3 + axis] = np.cross(np.eye(3)[axis], turned)
        information = np.einsum("nkia,kij,nkjb->nab", moves, weights, moves)
        gradient = np.einsum("nkia,kij,nkj->na", moves, weights, left)
        step = np.linalg.solve(information, gradient[..., None])[..., 0]
        turn, place = from_vector(step[:, 3:]) @ turn, place + step[:, :3]
    return turn, place


def fit(case: Case, truth: Truth) -> None:
    """The rigid least-squares fit (Kabsch, by SVD) to where markers were seen, then the robot's own place.

    Where markers count by weights it is where the weighted squares are least, from there by Newton's way.

    The phantom is planned where the fit has it. So it really is where the fit's inverse leads from there.
    """
    own, at = case.phantom_turn, case.phantom_place
    if truth.markers is not None:
        markers = truth.markers
        seen = markers + truth.seen_off
        middle, seen_middle = markers.mean(axis=0), seen.mean(axis=1)
        products = np.einsum(
            "ki,nkj->nij", markers - middle, seen - seen_middle[:, None]
        )
        left, _, right = np.linalg.svd(products)
        turn = right.transpose(0, 2, 1) @ left.transpose(0, 2, 1)
        mirror = np.ones((len(seen), 3))
        mirror[:, 2] = np.linalg.det(turn)
        turn = right.transpose(0, 2, 1) @ (mirror[..., None] * left.transpose(0, 2, 1))
        place = seen_middle - turn @ middle
        if truth.weights is not None:
            turn, place = weighted(markers, seen, truth.weights, turn, place)
        # Back: x_true = turn^T (x_planned - place), in the phantom's frame; then as seen in the world.
        back = turn.transpose(0, 2, 1)
        back_place = -(back @ place[..., None])[..., 0]
        truth.shift_turn = own @ back @ own.T
        truth.shift_place = at + back_place @ own.T - truth.shift_turn @ at
    # About the phantom's origin.
    base, off = truth.base_turn, truth.base_place
    truth.shift_place = (
        at + off + (base @ (truth.shift_place - at)[..., None])[..., 0]
    )
    truth.shift_turn = base @ truth.shift_turn


def hand_eye(
    case: Case, block: dict, random: np.random.Generator, truth: Truth
) -> None:
    """The robot's base is not where it is believed to be: a turn about the phantom's origin, and a way."""
    turn = np.radians(block["rotation_deg"]) * random.standard_normal((truth.count, 3))
    truth.base_turn = from_vector(turn)
    truth.base_place = block["translation_mm"] * 1e-3 * random.standard_normal((truth.count, 3))


def imaging(case: Case, block: dict, random: np.random.Generator, truth: Truth) -> None:
    """The target is anywhere in its voxel, and its centre is chosen with an error; or as was measured."""
    if "covariance_mm2" in block:
        covariance = covariances(block["covariance_mm2"])
        truth.unseen = random.multivariate_normal(np.zeros(3), covariance, truth.count, method="eigh")
        return
    voxel = np.array(block["voxel_mm"]) * 1e-3
    within = voxel * random.uniform(-0.5, 0.5, (truth.count, 3))
    truth.unseen = within + block["reader_mm"] * 1e-3 * random.standard_normal((truth.count, 3))


def needle(case: Case, block: dict, random: np.random.Generator, truth: Truth) -> None:
    """A force across the tip, in any direction, bends the needle from the guide's exit on; or it cuts its way."""
    if block["model"] == "tissue":
        needle_in_tissue(case, block, random, truth)
        return
    outer, bore = case.arm.tool.needle, block["bore_mm"] * 1e-3
    rigidity = block["young_gpa"] * 1e9 * np.pi * (outer**4 - bore**4) / 64.0
    # Squares of the force are exponential: its parts along two axes are normal.
    force = block["side_force_n"] * np.sqrt(random.exponential(1.0, truth.count))
    angle = random.uniform(0.0, 2.0 * np.pi, truth.count)
    length = case.depths[1]
    across = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
    truth.bent = np.array(
        [
            across * (force * s**2 * (3.0 * length - s) / (6.0 * rigidity))[:, None]
            for s in case.depths
        ]
    )


def needle_in_tissue(
    case: Case, block: dict, random: np.random.Generator, truth: Truth
) -> None:
    """Needles of many patients, in any direction or in that of the bevel as the hand holds it.

    What the play of the guide does is part of it, as the force presses the needle to the walls.
    """
    # With the depth of the turn that was chosen for the goal.
    block = defaults("NeedleBlock", case.blocks["needle"])
    tool = case.arm.tool
    play = 0.5 * clearance_of(case, case.blocks["guide"]) if "guide" in case.blocks else 0.0
    held = (tool.guide_length, case.depths[0], play)
    of = pickle.dumps((block, case.layers, tool.needle, held))
    if of not in KNOWN_BENDS:
        KNOWN_BENDS[of] = bending.bends(block, case.layers, tool.needle, held, np.random.default_rng(23))
        if block.get("turn_at") == "best":
            chosen, least = bending.best_turn(block, case.layers, tool.needle, held)
            assert chosen < BEST_TURN * least, f"a turn leaves {chosen} m, the best {least} m"
    known = KNOWN_BENDS[of]
    # Each once, as far as there are so many.
    order = random.permutation(known.shape[1])
    bends = known[:, np.resize(order, truth.count)]
    if case.pushed_towards is None:
        angle = random.uniform(0.0, 2.0 * np.pi, truth.count)
    else:
        middle = np.arctan2(case.pushed_towards[1], case.pushed_towards[0])
        angle = middle + np.radians(block["bevel_spread_deg"]) * random.standard_normal(truth.count)
    towards = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
    truth.bent = bends[..., None] * towards
    if not block["aim"]:
        return
    # The axis is to be aimed against the mean of what is drawn here.
    spread = np.radians(block["bevel_spread_deg"])
    mean = known[1].mean() * np.exp(-0.5 * spread**2) * np.append(case.pushed_towards, 0.0)
    off = np.linalg.norm(case.aim + mean) / np.linalg.norm(mean)
    assert off < AIM_SHARE, f"aimed by {case.aim} m against a mean bend of {mean} m"
    truth.bent[1] += case.aim


# What the turn that is chosen may leave beside the best, and how far an aim may be off the mean bend, as a share.
BEST_TURN, AIM_SHARE = 1.03, 0.03

# By what a goal's bends depend on: the same for all its configurations.
KNOWN_BENDS: dict[bytes, Array] = {}


def indentation(
    case: Case, block: dict, random: np.random.Generator, truth: Truth
) -> None:
    """Skin and target give way along the needle."""
    truth.pushed = np.array(
        [
            (block[f"{what}_mm"] + block[f"{what}_spread_mm"] * random.standard_normal(truth.count)) * 1e-3
            for what in ("skin", "target")
        ]
    )


def phases(block: dict, random: np.random.Generator, count: int) -> Array:
    """Phases of the breath: near the one that is met, or any where the hold fails."""
    any_phase = random.random(count)
    if block["free"]:
        return any_phase
    met = block["phase"] + block["phase_spread"] * random.standard_normal(count)
    return np.where(random.random(count) < block["hold_failure"], any_phase, met)


# What the guide says of a level without keys of its own, 1 and 1/s, and of the drift of skin and target, mm/s.
LEVEL = {"level_at_once": 0.045, "level_per_s": 0.0017}
DRIFT_MM_S = {"skin_drift_mm_s": (0.0, 0.0, 0.0), "target_drift_mm_s": (0.0, 0.0, 0.15)}


def given(block: dict, usual: dict) -> list:
    """Values of keys, of the block or the usual ones."""
    return [value if block.get(key) is None else block[key] for key, value in usual.items()]


def levels(block: dict, random: np.random.Generator, count: int) -> Array:
    """How far the end of expiration is from where the image shows it, of skin and target, as a share of the amplitude."""
    if block.get("since_image_s") is None:
        return np.zeros(count)
    at_once, per_s = given(block, LEVEL)
    variance = at_once**2 + (per_s * block["since_image_s"]) ** 2
    return np.sqrt(variance) * random.standard_normal(count)


def drifts(block: dict) -> Array:
    """How far skin and target have drifted while the breath was held, m."""
    held_s = block.get("held_s")
    return np.array(given(block, DRIFT_MM_S)) * 1e-3 * (0.0 if held_s is None else held_s)


def breathing(
    case: Case, block: dict, random: np.random.Generator, truth: Truth
) -> None:
    """Skin and target move by a level and `sin^4(pi phase)` (Lujan 1999) of their amplitudes, and drift.

    Beside a level, a breath that is held is at its phase exactly.
    """
    exact = {} if block.get("since_image_s") is None else {"phase_spread": 0.0}
    share = np.sin(np.pi * phases(block | exact, random, truth.count)) ** 4
    share = share + levels(block, random, truth.count)
    amplitudes = (np.array(block[key]) * 1e-3 for key in ("skin_mm", "target_mm"))
    truth.breath = np.array(
        [
            share[:, None] * (case.phantom_turn @ each) + case.phantom_turn @ drift
            for each, drift in zip(amplitudes, drifts(block), strict=True)
        ]
    )


# By the name of the block and of the report's source: section of the schema, and what it does. In this order.
SOURCES = {
    "calibration": ("CalibrationBlock", calibration),
    "encoder": ("EncoderBlock", encoder),
    "elasticity": ("ElasticityBlock", elasticity),
    "payload": ("PayloadBlock", payload),
    "friction": ("FrictionBlock", friction),
    "guide": ("GuideBlock", guide),
    "hand_eye": ("HandEyeBlock", hand_eye),
    "registration": ("RegistrationBlock", registration),
    "skin_markers": ("SkinMarkersBlock", skin_markers),
    "imaging": ("ImagingBlock", imaging),
    "needle": ("NeedleBlock", needle),
    "indentation": ("IndentationBlock", indentation),
    "breathing": ("BreathingBlock", breathing),
}
# Blocks that leave nothing at an arm that has come to rest.
WITHOUT_REST = {"control", "torque_limits"}


def spline(times: Array, values: Array, at: Array) -> tuple[Array, Array]:
    """Cubic spline through values, at rest at both ends: position and speed."""
    step = np.diff(times)
    slope = np.diff(values, axis=0) / step[:, None]
    count = len(times)
    matrix = np.zeros((count, count))
    right = np.zeros((count, values.shape[1]))
    matrix[0, :2] = 2.0 * step[0], step[0]
    matrix[-1, -2:] = step[-1], 2.0 * step[-1]
    right[0], right[-1] = 6.0 * slope[0], -6.0 * slope[-1]
    for i in range(1, count - 1):
        matrix[i, i - 1 : i + 2] = step[i - 1], 2.0 * (step[i - 1] + step[i]), step[i]
        right[i] = 6.0 * (slope[i] - slope[i - 1])
    bend = np.linalg.solve(matrix, right)
    i = np.clip(np.searchsorted(times, at, side="right") - 1, 0, count - 2)
    h = step[i, None]
    a, b = (times[i + 1] - at)[:, None], (at - times[i])[:, None]
    first, second = (
        values[i] / h - bend[i] * h / 6.0,
        values[i + 1] / h - bend[i + 1] * h / 6.0,
    )
    place = (bend[i] * a**3 + bend[i + 1] * b**3) / (6.0 * h) + first * a + second * b
    speed = (bend[i + 1] * b**2 - bend[i] * a**2) / (2.0 * h) - first + second
    return place, speed


def bristles_at_the_end(case: Case, model: dict, factors: Array) -> Array:
    """What bent bristles hold when the motion has ended, for factors (rows) on each joint's friction.

    `dz = dq - |dq| sigma z / g(v)`, solved exactly over steps in which the speed is constant.
    """
    end = case.times[-1]
    coarse = np.arange(case.times[0], end - 0.08, 2e-3)
    fine = end - 0.08 * np.linspace(1.0, 0.0, 2001) ** 2
    at = np.concatenate([coarse, fine])
    place, speed = spline(case.times, case.path, at)
    stiffness = model["bristle_stiffness_nm_rad"]
    z = np.zeros_like(factors)
    for k in range(len(at) - 1):
        way = place[k + 1] - place[k]
        ratio = 0.5 * (speed[k] + speed[k + 1]) / np.radians(model["stribeck_deg_s"])
        slip = model["coulomb_nm"] + (
            model["stiction_nm"] - model["coulomb_nm"]
        ) * np.exp(-(ratio**2))
        full = np.sign(way) * factors * slip / stiffness
        z = full + (z - full) * np.exp(-np.abs(way) * stiffness / (factors * slip))
    return stiffness * z


def friction_error(case: Case, truth: Truth) -> Array:
    """Reference minus position that friction leaves.

    While the joint creeps to its end, the servo's error holds what friction has beyond its compensation:
    `kp x = F - c`. Then the compensation goes, and the joint springs back by the way `d` that balances
    `kp (x + d) = F'`, on which the bristles unbend by the same law, from `F` towards `-F_s`.
    """
    model = truth.friction
    # The held torque is a smooth function of the factor alone: on a grid, then between.
    grid = np.linspace(0.05, 2.0, 79)
    held_on_grid = bristles_at_the_end(case, model, np.repeat(grid[:, None], 6, axis=1))
    factor = model["factor"]
    held = np.stack(
        [np.interp(factor[:, i], grid, held_on_grid[:, i]) for i in range(6)], axis=-1
    )
    kp = np.array(case.arm.data["servo"]["stiffness_nm_rad"])
    stiffness, sticking = model["bristle_stiffness_nm_rad"], model["stiction_nm"]
    direction = np.sign(held)
    compensated = model["compensation"] * sticking * direction
    full = factor * sticking / stiffness
    z = np.abs(held) / stiffness
    low, high = np.zeros_like(held), np.abs(compensated) / kp
    for _ in range(HALVINGS):
        way = 0.5 * (low + high)
        left = stiffness * ((z + full) * np.exp(-way / full) - full)
        balance = np.abs(held) - left + kp * way - np.abs(compensated)
        low, high = (
            np.where(balance < 0.0, way, low),
            np.where(balance < 0.0, high, way),
        )
    return (held - compensated) / kp + direction * 0.5 * (low + high)


def noise_covariance(case: Case, truth: Truth) -> Array:
    """Covariance of the joints that follow noisy encoders, one servo step after another.

    The loop about rest: `v += -h M^-1 (kp (x + n) + kd v + friction) / (1 + kp C)`, `x += h v`; what all noise so
    far has led to is the sum of the loop's responses to it.
    """
    servo = case.arm.data["servo"]
    kp, kd = np.array(servo["stiffness_nm_rad"]), np.array(servo["damping_nms_rad"])
    soft = 1.0 + kp * softest_loop(case) * (truth.softness.any())
    inverse = np.linalg.inv(mass_matrix(case.arm, case.target))
    own = truth.friction
    stiff, damped = kp.copy(), kd.copy()
    if own is not None:
        stiff = stiff + own["bristle_stiffness_nm_rad"]
        damped = damped + own["bristle_damping_nms_rad"] + own["viscous_nms_rad"]
    h = case.timestep
    from_x, from_v = (-h * inverse * (gain / soft) for gain in (stiff, damped))
    to_v = np.hstack([from_x, np.eye(6) + from_v])
    step = np.vstack([np.hstack([np.eye(6), np.zeros((6, 6))]) + h * to_v, to_v])
    kick = -h * inverse * (kp / soft) * truth.noise
    response = np.vstack([h * kick, kick])
    total = np.zeros((12, 12))
    for _ in range(3000):
        total += response @ response.T
        response = step @ response
    return total[:6, :6]


def rest(case: Case, truth: Truth, random: np.random.Generator) -> Array:
    """Joint positions at which the arms come to rest.

    The servo holds `kp (reference - reading)` beyond the weight that it believes in; the gear twists by what it
    carries; the reading is the motor's angle and its error.
    """
    arm, target = case.arm, case.target[None]
    kp = np.array(arm.data["servo"]["stiffness_nm_rad"])
    body = arm.tool.body
    believed = gravity_torque(
        arm, arm.chain, target, np.array([body.mass]), body.com[None]
    )
    believed *= arm.data["believed_m_s2"] / GRAVITY_M_S2
    here = arm.data["world_m_s2"] / GRAVITY_M_S2
    stuck = friction_error(case, truth) if truth.friction is not None else 0.0
    q = target
    for _ in range(BALANCE_STEPS):
        load = here * gravity_torque(
            arm, truth.chain, q, truth.tool_mass, truth.tool_com
        )
        q = (
            target
            - (load - believed) / kp
            - stuck
            - truth.reading
            - (truth.softness * twist(case, load) if truth.softness.any() else 0.0)
        )
    if truth.noise is not None and truth.noise.any():
        spread = noise_covariance(case, truth)
        q = q + random.multivariate_normal(
            np.zeros(6), spread, truth.count, method="eigh"
        )
    return q


def planned(case: Case) -> list[Array]:
    """Where the needle should be at the skin and at the target."""
    at = posture(case.arm, case.arm.chain, case.target[None])
    turn, place = flange(case.arm.chain, at)
    exit_turn = turn[0] @ case.arm.tool.exit_turn
    exit_place = place[0] + turn[0] @ case.arm.tool.exit_place
    return [exit_place + depth * exit_turn[:, 2] for depth in case.depths]


def errors(case: Case, truth: Truth, random: np.random.Generator) -> list[Array]:
    """Needle minus where it should be, at skin and target, in the goal's axes."""
    tool = case.arm.tool
    fit(case, truth)
    truth.chain = moved(case.arm.chain, truth.deviations)
    at = posture(case.arm, truth.chain, rest(case, truth, random))
    turn, place = flange(truth.chain, at)
    entry, leave = truth.in_guide[:, 0], truth.in_guide[:, 1]
    across = leave - entry
    along = np.column_stack([across, np.full(len(across), tool.guide_length)])
    along /= np.linalg.norm(along, axis=1)[:, None]
    start = np.column_stack([leave, np.zeros(len(leave))])
    found = []
    unseen = [np.zeros((1, 3)), truth.unseen @ case.phantom_turn.T]
    for k, (wanted, depth, breath) in enumerate(
        zip(planned(case), case.depths, truth.breath, strict=True)
    ):
        in_tool = (start + depth * along) @ tool.exit_turn.T + tool.exit_place
        needle = place + (turn @ in_tool[..., None])[..., 0]
        # Breath moves the patient as he really lies.
        moved_by = (truth.shift_turn @ (breath + unseen[k])[..., None])[..., 0]
        really = truth.shift_turn @ wanted + truth.shift_place + moved_by
        error = (needle - really) @ case.axes.T + truth.bent[k]
        error = error - truth.pushed[k][:, None] * np.array([0.0, 0.0, 1.0])
        found.append(np.broadcast_to(error, (truth.count, 3)))
    return found

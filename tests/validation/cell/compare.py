"""Clearances of whole cells by needlebench against Coal and Pinocchio, posture by posture.

    cargo build --release -p needlebench-programs-cell
    python3 -m venv env && env/bin/pip install -r tests/validation/requirements.txt
    env/bin/python tests/validation/cell/compare.py --exporter target/release/cell_export

Places the flange by Pinocchio at all solutions of inverse kinematics for a thousand postures of each scenario's arm.

Builds every scenario's cell a second time (`cell.py`), asks Coal for the signed distance of every
pair at the exporter's random postures, and fails where the two differ and needlebench cannot be
proved right (`certificate.py`). Times both on the same postures. Writes `report.json` and
`report.txt`; exit status 1 if anything is beyond its limit.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from cell import ROOT, Cell, build_cell, coal_mesh, coal_shape, pose
from certificate import gap, widest_gap
from report import Tally, plain, quantiles, text_of

Array = np.ndarray

# The two may differ by this while apart, m; everything beyond is looked into.
AGREEMENT_M = 1e-6
# An overestimate beyond this is a failure, m.
OVERESTIMATE_M = 1e-9
# Poses from two readers of the same files: sums and products of a dozen numbers below 3.
PLACEMENT_M = 1e-12
# A solution's flange from that of the posture whose pose was solved, m and rad: what `Kinematics::solve` states.
SOLUTION = 1e-12
# A posture is among the solutions of its own pose within this, rad, where no direction of the flange is slower than the
# second number of that of the fastest.
FOUND_RAD = 1e-9
SINGULAR = 1e-3
# The exporter solves so many postures' poses.
SOLVED = 1000
# Below this the sign of a distance is no statement, m.
SIGN_M = 1e-8
# Coal's tolerances: for the comparison; the timing has its defaults.
TOLERANCE = 1e-10
ITERATIONS = 1000
TIMING_PASSES = 3
# Cells that are made for this comparison, with what shipped scenarios lack, and their share of postures.
CELLS = Path(__file__).resolve().parent / "cells"
OF_CELLS = 20
# Coal gives up with answers far beyond this, m.
BEYOND_M = 1e6


@dataclass
class Answers:
    """Both sides' answers to all postures; arrays by posture and body pair."""

    q: Array
    ours: Array
    our_points: Array  # on A and on B
    our_normal: Array
    our_solids: Array  # indices into the cell's solids
    coal: Array
    coal_points: Array
    coal_normal: Array
    coal_solids: Array
    links: tuple[Array, Array]  # rotations and positions of world and links by posture


def read_ours(cell: Cell, file: Path) -> tuple[Array, Array]:
    """Joint positions, and per posture and pair the numbers of the export."""
    width, pairs = cell.header["numbers_per_pair"], len(cell.header["pairs"])
    rows = np.fromfile(file, dtype="<f8").reshape(-1, 6 + pairs * width)
    return rows[:, :6].copy(), rows[:, 6:].reshape(len(rows), pairs, width)


def ask_both(cell: Cell, file: Path) -> Answers:
    """Take our answers and ask Coal."""
    q, ours = read_ours(cell, file)
    count, pairs = ours.shape[:2]
    data, geometry_data = cell.model.createData(), cell.geometry.createData()
    for request in geometry_data.distanceRequests:
        request.enable_signed_distance = True
        request.gjk_tolerance = request.epa_tolerance = TOLERANCE
        request.gjk_max_iterations = request.epa_max_iterations = ITERATIONS
    # Every body pair's solid pairs in a row; what a row has less than the longest is infinite.
    starts = np.flatnonzero(np.diff(cell.pair_of, prepend=-1))
    lengths = np.diff(np.append(starts, len(cell.pair_of)))
    columns = np.arange(lengths.max())[None]
    members = np.where(columns < lengths[:, None], starts[:, None] + columns, len(cell.pair_of))
    found = np.empty((count, pairs))
    points, normals = np.empty((count, pairs, 2, 3)), np.empty((count, pairs, 3))
    solids = np.empty((count, pairs, 2), dtype=int)
    rotations, positions = np.empty((count, 7, 3, 3)), np.empty((count, 7, 3))
    every = np.array([(pair.first, pair.second) for pair in cell.geometry.collisionPairs])
    for k in range(count):
        pin.computeDistances(cell.model, data, cell.geometry, geometry_data, q[k])
        results = geometry_data.distanceResults
        values = np.array([result.min_distance for result in results] + [np.inf])
        values[values < -BEYOND_M] = np.inf
        nearest = members[np.arange(pairs), values[members].argmin(axis=1)]
        found[k] = np.where(np.isinf(values[nearest]), np.nan, values[nearest])
        solids[k] = every[nearest]
        for pair, best in enumerate(nearest.tolist()):
            result = results[best]
            points[k, pair] = result.getNearestPoint1(), result.getNearestPoint2()
            normals[k, pair] = result.normal
        for link in range(7):
            rotations[k, link] = data.oMi[link].rotation
            positions[k, link] = data.oMi[link].translation
    first = np.array(cell.first_solid)
    bodies = np.array([[entry["a"], entry["b"]] for entry in cell.header["pairs"]])
    return Answers(
        q=q,
        ours=ours[:, :, 0],
        our_points=ours[:, :, 1:7].reshape(count, pairs, 2, 3),
        our_normal=ours[:, :, 7:10],
        our_solids=ours[:, :, 10:12].astype(int) + first[bodies][None],
        coal=found,
        coal_points=np.clip(points, -BEYOND_M, BEYOND_M),
        coal_normal=normals,
        coal_solids=solids,
        links=(rotations, positions),
    )


def solid_poses(cell: Cell, answers: Answers, solid: int, rows: Array) -> tuple[Array, Array]:
    """Rotations and positions of a solid in the world at some postures."""
    item = cell.solids[solid]
    rotation, position = (part[rows, item.link] for part in answers.links)
    return rotation @ item.rotation, rotation @ item.position + position


def outside(cell: Cell, answers: Answers, solids: Array, points: Array) -> Array:
    """How far witness points lie outside their solids; NaN where that is not known."""
    result = np.full(solids.shape, np.nan)
    for solid in np.unique(solids):
        if cell.solids[solid].shape.kind == "mesh":
            continue
        at = np.nonzero(solids == solid)
        rotation, position = solid_poses(cell, answers, solid, at[0])
        local = np.einsum("kij,ki->kj", rotation, points[at] - position)
        result[at] = cell.solids[solid].shape.outside(local)
    return result


def our_certificates(cell: Cell, answers: Answers) -> Array:
    """Gap along our normal of our closest solids: a lower bound of their signed distance."""
    result = np.full(answers.ours.shape, np.nan)
    keys = answers.our_solids[..., 0] * len(cell.solids) + answers.our_solids[..., 1]
    for key in np.unique(keys):
        a, b = divmod(int(key), len(cell.solids))
        if "mesh" in (cell.solids[a].shape.kind, cell.solids[b].shape.kind):
            continue
        at = np.nonzero(keys == key)
        result[at] = gap(
            a=cell.solids[a].shape,
            b=cell.solids[b].shape,
            pose_a=solid_poses(cell, answers, a, at[0]),
            pose_b=solid_poses(cell, answers, b, at[0]),
            n=answers.our_normal[at],
        )
    return result


def searched(
    cell: Cell, answers: Answers, at: tuple[int, int], solids: Array, enough: float
) -> float:
    """Second opinion on two solids at a posture and pair: the widest gap over a dense search of
    directions, or one that is enough."""
    row = np.array([at[0]])
    poses = []
    for solid in solids:
        rotation, position = solid_poses(cell, answers, int(solid), row)
        poses.append((rotation[0], position[0]))
    hints = np.vstack([answers.our_normal[at], answers.coal_normal[at]])
    return widest_gap(
        a=cell.solids[solids[0]].shape,
        b=cell.solids[solids[1]].shape,
        pose_a=poses[0],
        pose_b=poses[1],
        hints=np.vstack([hints, -hints]),
        enough=enough,
    )


def settle(cell: Cell, answers: Answers, tally: Tally, at: tuple[int, int]) -> str | None:
    """Who is right about a posture and pair on which the two differ; `None` if we are."""
    ours, theirs = answers.ours[at], answers.coal[at]
    names = " and ".join(cell.body_names(at[1]))
    apart = ours > 0.0
    solids = (*answers.our_solids[at], *answers.coal_solids[at])
    message = f"{names} at posture {at[0]}: needlebench {ours} m, Coal {theirs} m"
    if "mesh" in {cell.solids[solid].shape.kind for solid in solids}:
        # Coal knows a mesh's surface and no depth: one side of it is like the other.
        return message if apart else None
    if np.isnan(theirs) or ours > theirs:
        # Ours is the larger: every solid that Coal sees nearer has to be shown further.
        proved = searched(cell, answers, at, answers.coal_solids[at], ours - AGREEMENT_M)
        right = proved >= ours - AGREEMENT_M
    elif apart:
        # Ours is the smaller: two points as close as we say show it.
        a, b = answers.our_points[at]
        right = np.linalg.norm(b - a) <= ours + AGREEMENT_M
    else:
        # Ours is the deeper: no direction may show a shallower way out.
        proved = searched(cell, answers, at, answers.our_solids[at], ours + 2.0 * AGREEMENT_M)
        right = proved <= ours + AGREEMENT_M
    if not right:
        return message
    tally.coal_wrong += 1
    tally.coal_wrong_apart += apart and theirs > 0.0
    tally.coal_wrong_sign += apart != (theirs > 0.0)
    difference = np.array([ours - theirs])
    tally.coal_too_deep.take(difference, lambda _: names)
    tally.coal_too_shallow.take(-difference, lambda _: names)
    return None


def judge(cell: Cell, answers: Answers) -> Tally:
    """Compare, and look into every disagreement."""
    count, pairs = answers.ours.shape
    tally = Tally(
        name=cell.header["name"],
        postures=count,
        body_pairs=pairs,
        solid_pairs=len(cell.pair_of),
        placement_difference_m=cell.placement_difference_m,
    )

    def name(index: int) -> str:
        return " and ".join(cell.body_names(index % pairs)) + f" at posture {index // pairs}"

    if not tally.placement_difference_m <= PLACEMENT_M:
        tally.failures.append(f"geometry differs by {tally.placement_difference_m} m")
    difference = answers.ours - answers.coal
    agreed = np.abs(difference) <= AGREEMENT_M
    apart, deep = answers.ours > SIGN_M, answers.ours < -SIGN_M
    tally.apart, tally.penetrating = int(apart.sum()), int(deep.sum())
    for posture, pair in zip(*np.nonzero(~agreed), strict=True):
        failure = settle(cell, answers, tally, (int(posture), int(pair)))
        if failure:
            tally.failures.append(failure)
    both = agreed & apart
    tally.apart_difference_m = quantiles(np.abs(difference[both]))
    tally.penetrating_difference_m = quantiles(np.abs(difference[agreed & deep]))
    shown = np.where(agreed, difference, 0.0).ravel()
    tally.largest_above_coal.take(shown, name)
    tally.largest_below_coal.take(-shown, name)

    # Coal's points are an upper bound as far as they lie in the shapes.
    off = outside(cell, answers, answers.coal_solids, answers.coal_points)
    seen = apart & (answers.coal > 0.0)
    tally.coal_outside_shapes.take(np.where(seen[..., None], off, 0.0).max(axis=2).ravel(), name)
    between = answers.coal_points[:, :, 1] - answers.coal_points[:, :, 0]
    upper = np.linalg.norm(between, axis=2) + np.nan_to_num(off).sum(axis=2)
    over = np.where(seen, answers.ours - upper, 0.0)
    tally.largest_above_upper_bound.take(over.ravel(), name)
    # Our own normal proves our distance, apart and in penetration; or else a better direction.
    unproved = np.nan_to_num(answers.ours - our_certificates(cell, answers))
    for at in zip(*np.nonzero(unproved > OVERESTIMATE_M), strict=True):
        enough = answers.ours[at] - OVERESTIMATE_M
        proved = searched(cell, answers, at, answers.our_solids[at], enough)
        unproved[at] = min(unproved[at], answers.ours[at] - proved)
        tally.proved_by_search += 1
    tally.largest_unproved.take(unproved.ravel(), name)
    for worst, what in (
        (tally.largest_above_upper_bound, "more than the distance of two points of the shapes"),
        (tally.largest_unproved, "more than the gap along any direction found"),
    ):
        if worst.value > OVERESTIMATE_M:
            tally.failures.append(f"{worst.where}: {worst.value} m {what}")

    classes = np.array([pair["class"] for pair in cell.header["pairs"]])
    for kind in dict.fromkeys(classes):
        members = classes == kind
        # Where Coal is shown wrong it has no say in the minimum.
        theirs = np.where(agreed, answers.coal, answers.ours)[:, members].min(axis=1)
        least = answers.ours[:, members].min(axis=1)
        tally.class_difference_m[str(kind)] = {
            **quantiles(np.abs(least - theirs)),
            "least_m": float(least.min()),
        }
    return tally


def judge_solutions(cell: Cell, q: Array, file: Path) -> dict:
    """Flange poses of inverse kinematics by Pinocchio, and whether each posture is among the solutions of its pose."""
    rows = np.fromfile(file, dtype="<f8").reshape(-1, 7)
    data, flange = cell.model.createData(), cell.model.getFrameId("tool0")

    def placed(joints: Array) -> pin.SE3:
        pin.framesForwardKinematics(cell.model, data, joints)
        return data.oMf[flange].copy()

    numbers = rows[:, 0].astype(int)
    worst_m = worst_rad = 0.0
    regular, lost = 0, []
    postures = min(SOLVED, len(q))
    for number in range(postures):
        found = rows[numbers == number, 1:]
        expected = placed(q[number])
        for joints in found:
            off = expected.actInv(placed(joints))
            worst_m = max(worst_m, float(np.linalg.norm(off.translation)))
            worst_rad = max(worst_rad, float(np.linalg.norm(pin.log3(off.rotation))))
        jacobian = pin.computeFrameJacobian(cell.model, data, q[number], flange, pin.LOCAL_WORLD_ALIGNED)
        speeds = np.linalg.svd(jacobian, compute_uv=False)
        if speeds[-1] < SINGULAR * speeds[0]:
            continue
        regular += 1
        turns = np.abs(np.remainder(found - q[number] + np.pi, 2.0 * np.pi) - np.pi).max(axis=1, initial=0.0)
        if not len(found) or turns.min() > FOUND_RAD:
            lost.append(number)
    failures = [f"posture {number} is not among the solutions of its pose" for number in lost]
    if not max(worst_m, worst_rad) <= SOLUTION:
        failures.append(f"solutions of inverse kinematics are off by {worst_m} m and {worst_rad} rad")
    return {
        "postures": postures,
        "solutions": len(rows),
        "regular": regular,
        "worst_m": worst_m,
        "worst_rad": worst_rad,
        "failures": failures,
    }


def quickest_s(call, arguments: list) -> float:
    """Mean time of a call over its arguments in the quickest pass."""
    best = float("inf")
    for _ in range(TIMING_PASSES):
        start = time.perf_counter()
        for argument in arguments:
            call(argument)
        best = min(best, time.perf_counter() - start)
    return best / max(len(arguments), 1)


def time_posture(cell: Cell, q: Array) -> dict:
    """Time of Pinocchio's `computeDistances` per posture, without what Python's call takes."""
    data, geometry_data = cell.model.createData(), cell.geometry.createData()
    nothing, no_geometry = pin.Model(), pin.GeometryModel()
    no_data, no_geometry_data = nothing.createData(), no_geometry.createData()
    rows = list(np.ascontiguousarray(q[: cell.header["timed_postures"]]))
    empty = [np.zeros(0)] * len(rows)
    overhead = quickest_s(
        lambda each: pin.computeDistances(nothing, no_data, no_geometry, no_geometry_data, each),
        empty,
    )
    total = quickest_s(
        lambda each: pin.computeDistances(cell.model, data, cell.geometry, geometry_data, each),
        rows,
    )
    header = cell.header
    return {
        "coal_pinocchio": total - overhead,
        "python_call": overhead,
        "needlebench_all_pairs": header["all_pairs_s"],
        "needlebench_minimum_per_class": header["minimum_per_class_s"],
        "times_faster_all_pairs": (total - overhead) / header["all_pairs_s"],
        "times_faster_minimum_per_class": (total - overhead) / header["minimum_per_class_s"],
    }


def compare_mesh(export: dict) -> tuple[list[dict], list[str]]:
    """Single shapes against a mesh that is not convex: differences and times."""
    value = export["mesh"]
    mesh = coal_mesh(vertices=np.array(value["vertices_m"]), triangles=np.array(value["triangles"]))
    still = coal.Transform3s(np.eye(3), np.zeros(3))
    ball = coal.Sphere(0.01)
    rows, failures = [], []
    for case in export["cases"]:
        shape = coal_shape(case["shape"])
        poses = [pose(each) for each in case["mesh_from_shape"]]
        places = [coal.Transform3s(each.rotation, each.translation) for each in poses]
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        exact = coal.DistanceRequest()
        exact.gjk_tolerance, exact.gjk_max_iterations = TOLERANCE, ITERATIONS

        def distance(a, place, b, request=request, result=result) -> float:
            result.clear()
            return coal.distance(a, place, b, still, request, result)

        theirs = np.array([distance(shape, place, mesh, request=exact) for place in places])
        overhead = quickest_s(lambda place: distance(ball, place, ball), places)
        to_mesh = partial(distance, shape, b=mesh)
        times = [quickest_s(to_mesh, [each]) for each in places]
        difference = np.array(case["distance_m"]) - theirs
        rows.append(
            {
                "name": case["name"],
                "triangles": len(value["triangles"]),
                "difference_m": quantiles(np.abs(difference)),
                "largest_above_coal_m": float(difference.max()),
                "coal_median_s": float(np.median(times)) - overhead,
                "needlebench_median_s": float(np.median(case["time_s"])),
                "coal_worst_s": float(np.max(times)) - overhead,
                "needlebench_worst_s": float(np.max(case["time_s"])),
            }
        )
        if np.abs(difference).max() > AGREEMENT_M:
            worst = int(np.abs(difference).argmax())
            failures.append(f"{case['name']} and mesh: {difference[worst]} m off Coal")
    return rows, failures


def main() -> int:
    """Run the exporter, compare, report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--exporter", type=Path, required=True, help="the built `cell_export`")
    parser.add_argument("--out", type=Path, default=ROOT / "target" / "validation-cell")
    parser.add_argument("--postures", type=int, default=2000, help="per scenario")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("scenarios", nargs="*", type=Path)
    arguments = parser.parse_args()
    shipped = sorted((ROOT / "scenarios").glob("*.toml"))
    chosen = [path.resolve() for path in arguments.scenarios or [*shipped, *CELLS.glob("*.toml")]]
    out = arguments.out.resolve()
    command = [str(arguments.exporter.resolve()), "--out", str(out)]
    command += ["--seed", str(arguments.seed), "--surfaces"]
    # Cells of meshes and hulls take several times as long a posture.
    for share, part in [
        (1, [path for path in chosen if path.parent != CELLS]),
        (OF_CELLS, sorted(path for path in chosen if path.parent == CELLS)),
    ]:
        if part:
            names = [str(path.relative_to(ROOT)) for path in part]
            count = ["--postures", str(arguments.postures // share)]
            subprocess.run([*command, *count, *names], check=True, cwd=ROOT)

    tallies = []
    solved = {}
    names = [path.stem for path in chosen]
    for name in [*names, *(f"{name}_surface" for name in names)]:
        header_file = out / f"{name}.json"
        cell = build_cell(header_file)
        answers = ask_both(cell, header_file.with_suffix(".f64"))
        tally = judge(cell, answers)
        tally.timing_s = time_posture(cell, answers.q)
        solved[name] = judge_solutions(cell, answers.q, header_file.with_suffix(".ik.f64"))
        tally.failures += solved[name]["failures"]
        tallies.append(tally)
    meshes, failures = compare_mesh(json.loads((out / "mesh.json").read_text()))
    failures += [f"{each.name}: {failure}" for each in tallies for failure in each.failures]
    text = text_of(tallies, meshes)
    report = {
        "versions": {"coal": coal.__version__, "pinocchio": pin.__version__},
        "scenarios": tallies,
        "mesh": meshes,
        "inverse_kinematics": solved,
        "failures": failures,
    }
    (out / "report.json").write_text(json.dumps(report, default=plain, indent=1) + "\n")
    (out / "report.txt").write_text(text + "\n")
    print(text)
    apart, deep = (
        max(getattr(each, f"{kind}_difference_m")["max"] for each in tallies) * 1e9 for kind in ("apart", "penetrating")
    )
    print(f"figure postures {sum(each.postures for each in tallies)}")
    print(f"figure apart_nm {apart:.3g}\nfigure penetrating_nm {deep:.3g}")
    print(f"figure above_nm {max(each.largest_above_upper_bound.value for each in tallies) * 1e9:.3g}")
    for word in ("m", "rad"):
        print(f"figure solutions_{word} {max(each[f'worst_{word}'] for each in solved.values()):.2g}")
    print(f"figure solutions {sum(each['solutions'] for each in solved.values())}")
    for failure in failures[:20]:
        print(f"error: {failure}", file=sys.stderr)
    if len(failures) > 20:
        print(f"error: and {len(failures) - 20} more", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""Matching and registration of markers, beside brute force and scipy.

Nothing of needlebench is used but the answers of `markers_export`:

- matches: the best of all partial assignments, each fitted by singular values (Kabsch), and the best of those that
  contradict it;
- weighted registration: `scipy.optimize.least_squares` over a rotation vector and a translation, weights renewed until
  they do not change; covariance from its Jacobian, by finite differences;
- error at a target: a simulation with that fit.

    cargo build --release -p needlebench-programs-imaging
    python3 -m venv env && env/bin/pip install -r tests/validation/imaging/requirements.txt
    env/bin/python tests/validation/imaging/markers/check.py --exporter target/release/markers_export
"""

import argparse
import itertools
import json
import subprocess
import sys

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

LEFT_OUT = 30.0
PLACEMENT_M = 5e-4
# What scipy stops at.
POSE_M = 2e-8
COVARIANCE_SHARE = 1e-3
COST = 1e-3
# Five standard errors of the rms of so many draws are 4 %.
DRAWS = 4000
TRE_SHARE = 0.05


def kabsch(a, b):
    ca, cb = a.mean(0), b.mean(0)
    u, _, vt = np.linalg.svd((a - ca).T @ (b - cb))
    d = np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))])
    r = vt.T @ d @ u.T
    return r, cb - r @ ca


def cost_of(pairs, detected, known, variance):
    a = np.array([detected[d] for _, d in pairs])
    b = np.array([known[k] for k, _ in pairs])
    r, t = kabsch(a, b)
    return float(((a @ r.T + t - b) ** 2).sum() / variance) + LEFT_OUT * (len(known) - len(pairs))


def brute_force(detected, known, variance):
    """All partial assignments of three pairs or more, the cheapest first."""
    found = []
    for size in range(3, min(len(detected), len(known)) + 1):
        for rows in itertools.combinations(range(len(known)), size):
            for columns in itertools.permutations(range(len(detected)), size):
                pairs = tuple(zip(rows, columns, strict=True))
                found.append((cost_of(pairs, detected, known, variance), pairs))
    return sorted(found)


def contradicts(a, b):
    return any((k == m) != (d == e) for k, d in a for m, e in b)


def weighted(a, b, ca, cb):
    """Iterated weighted fit of `a` to `b` with covariances `ca`, `cb`: rotation vector, translation, residuals' function."""
    r, t = kabsch(a, b)
    x = np.concatenate([Rotation.from_matrix(r).as_rotvec(), t])
    for _ in range(50):
        r = Rotation.from_rotvec(x[:3]).as_matrix()
        roots = [np.linalg.cholesky(np.linalg.inv(r @ p @ r.T + q)).T for p, q in zip(ca, cb, strict=True)]

        def residuals(x, roots=roots):
            placed = a @ Rotation.from_rotvec(x[:3]).as_matrix().T + x[3:]
            return np.concatenate([w @ (p - q) for w, p, q in zip(roots, placed, b, strict=True)])

        fit = least_squares(residuals, x, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale=[1, 1, 1, 0.1, 0.1, 0.1])
        moved = np.abs(fit.x - x).max()
        x = fit.x
        if moved < 1e-12:
            break
    return x, fit


def random_pose(rng):
    return Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.3, 0.3, 3)


def random_covariance(rng, sigma):
    r = Rotation.random(rng=rng).as_matrix()
    return r @ np.diag((sigma * rng.uniform(0.2, 1.5, 3)) ** 2) @ r.T


def case(detected, known, cd, ck, target):
    def place(p, c):
        return {"at_m": list(p), "covariance_m2": [list(row) for row in c]}

    return {
        "detected": [place(p, c) for p, c in zip(detected, cd, strict=True)],
        "known": [place(p, c) for p, c in zip(known, ck, strict=True)],
        "target_m": list(target),
    }


def matching_cases(rng, count):
    cases = []
    for n in range(count):
        known = rng.uniform(-0.1, 0.1, (5, 3))
        if n % 3 == 1:
            # Nearly its own mirror image, in a plane: two matches fit.
            known = np.array([[x, y, 0.0] for x, y in [(-0.05, 0.0), (0.05, 0.0), (-0.03, 0.06), (0.03, 0.06)]])
            known += rng.normal(0.0, 8e-4, known.shape)
        r, t = random_pose(rng)
        seen = (known - t) @ r + rng.normal(0.0, 2e-4, known.shape)
        keep = rng.permutation(len(known))[: len(known) - n % 2]
        false = rng.uniform(-0.4, 0.4, (5 - len(keep), 3))
        detected = np.concatenate([seen[keep], false])
        # Equal and isotropic, so that the fit by singular values is the weighted one.
        cases.append((detected, known))
    return cases


def ask(exporter, cases):
    text = json.dumps(cases)
    return json.loads(subprocess.run([exporter], input=text, capture_output=True, text=True, check=True).stdout)


def check_matching(exporter, rng, report):
    cases = matching_cases(rng, 24)
    sigma = 1e-4
    own = np.eye(3) * sigma**2
    answers = ask(
        exporter,
        [case(d, k, [own] * len(d), [own] * len(k), [0, 0, 0]) for d, k in cases],
    )
    variance = 2 * sigma**2 + PLACEMENT_M**2
    refused = 0
    for n, ((detected, known), answer) in enumerate(zip(cases, answers, strict=True)):
        ranked = brute_force(detected, known, variance)
        best_cost, best = ranked[0]
        second = next(((c, p) for c, p in ranked if contradicts(p, best)), None)
        separation = (second[0] - best_cost) ** 0.5 if second else np.inf
        if "error" in answer:
            refused += 1
            report(f"match {n}: refused at {separation:.2f} sigma", separation < 1.0, answer["error"])
            continue
        match = answer["match"]
        ours = tuple((p["reference"], p["detected"]) for p in match["pairs"])
        report(f"match {n}: best of {len(ranked)} assignments", ours == best, f"{ours} for {best}")
        if separation < 10.0:
            seen = (match["second_best"] or {}).get("separation_sigmas", np.inf)
            report(f"match {n}: second best {separation:.3f} sigma", abs(seen - separation) < COST * separation + 1e-3, seen)
        else:
            report(f"match {n}: no second best", match["second_best"] is None, match["second_best"])
    print(f"matching: {len(cases)} cases, {refused} of them ambiguous and refused")


def check_registration(exporter, rng, report):
    cases, truths = [], []
    for n in range(20):
        known = rng.uniform(-0.1, 0.1, (4 + n % 5, 3))
        r, t = random_pose(rng)
        cd = [random_covariance(rng, 2e-4) for _ in known]
        ck = [random_covariance(rng, 2e-4) for _ in known]
        detected = np.array([rng.multivariate_normal(r.T @ (p - t), c) for p, c in zip(known, cd, strict=True)])
        touched = np.array([rng.multivariate_normal(p, c) for p, c in zip(known, ck, strict=True)])
        target = r.T @ (np.array([0.02, 0.05, -0.03]) - t)
        cases.append((detected, touched, cd, ck, target))
        truths.append((r, t, known))
    answers = ask(exporter, [case(*c) for c in cases])
    worst = [0.0, 0.0]
    for n, ((a, b, ca, cb, target), answer) in enumerate(zip(cases, answers, strict=True)):
        if "error" in answer:
            report(f"registration {n}", False, answer["error"])
            continue
        x, fit = weighted(a, b, ca, cb)
        r = Rotation.from_rotvec(x[:3]).as_matrix()
        at = r @ target + x[3:]
        off = np.abs(at - answer["tre"]["at_m"]).max()
        # Derivative of the target's place by the six parameters, by differences.
        step = 1e-6
        moved = [
            (Rotation.from_rotvec((x + s * e)[:3]).as_matrix() @ target + (x + s * e)[3:])
            for e in np.eye(6)
            for s in (step, -step)
        ]
        by = np.array([(p - m) / (2 * step) for p, m in zip(moved[::2], moved[1::2], strict=True)]).T
        covariance = by @ np.linalg.inv(fit.jac.T @ fit.jac) @ by.T
        share = np.abs(covariance - answer["tre"]["covariance_m2"]).max() / np.abs(covariance).max()
        chi_square = abs(2 * fit.cost - answer["registration"]["chi_square"])
        worst = [max(worst[0], off), max(worst[1], share)]
        report(f"registration {n}: target", off < POSE_M, off)
        report(f"registration {n}: covariance", share < COVARIANCE_SHARE, share)
        report(f"registration {n}: chi-square", chi_square < COST, chi_square)
    print(f"registration: {len(cases)} cases, target within {worst[0]:.1e} m, covariance within {worst[1]:.1e} of scipy's")

    r, t, known = truths[3]
    _, _, cd, ck, target = cases[3]
    predicted = answers[3]["tre"]["rms_m"]
    roots = [(np.linalg.cholesky(p), np.linalg.cholesky(q)) for p, q in zip(cd, ck, strict=True)]
    draws = []
    for _ in range(DRAWS):
        noise = rng.standard_normal((len(known), 2, 3))
        a = np.array([r.T @ (p - t) + w @ e[0] for p, (w, _), e in zip(known, roots, noise, strict=True)])
        b = np.array([p + w @ e[1] for p, (_, w), e in zip(known, roots, noise, strict=True)])
        draws.append(case(a, b, cd, ck, target))
    errors = [
        np.sum((np.array(answer["tre"]["at_m"]) - (r @ target + t)) ** 2)
        for answer in ask(exporter, draws)
        if "tre" in answer
    ]
    simulated = float(np.mean(errors) ** 0.5)
    report("simulated error at the target", abs(simulated / predicted - 1) < TRE_SHARE, (simulated, predicted))
    print(f"error at the target: predicted {predicted * 1e3:.4f} mm, simulated {simulated * 1e3:.4f} mm ({len(errors)} draws)")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--exporter", required=True)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    failures = []

    def report(what, passed, seen):
        if not passed:
            failures.append(what)
            print(f"FAILED {what}: {seen}")

    rng = np.random.default_rng(arguments.seed)
    check_matching(arguments.exporter, rng, report)
    check_registration(arguments.exporter, rng, report)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()

"""Whether results have the same bytes on processors of several kinds.

    python check.py --program target/release/needlebench [--static PROGRAM] [--mujoco] [--require-emulator]

A static study, its shards computed on unlike machines, and motions of an imperfect arm in rapier: as this processor
computes them, with variants of the C library's functions switched off, and on an emulated Nehalem (2008: no AVX, no
fused multiply-add) and Haswell (2013: AVX2). `--static` names a program that is linked to
another C library: same bytes again. `--mujoco` counts what differs in MuJoCo, whose arithmetic is its own.

Python's standard library alone; the emulator is qemu-user.
"""

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[3]
# Variants of elementary functions that glibc picks by the processor; names of versions before 2.33 too.
PLAIN = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable,-FMA4_Usable"
ELEMENTARY = {
    name + suffix
    for name in (
        "sin cos tan asin acos atan atan2 sincos sinh cosh tanh asinh acosh atanh exp exp2 exp10 expm1 log log2 log10"
        " log1p pow cbrt hypot erf erfc tgamma lgamma"
    ).split()
    for suffix in ("", "f")
}

STUDIES = {
    "static": """
name = "arithmetic"
scenario = {scenarios}/studies/chest.toml"
goals = ["right_upper_anterior"]
seed = 3
mode = "static"

[sampling]
method = "sobol"
samples = 16

[[factors]]
name = "size"
key = "phantom.model"
values = ["female-p5-supine", "male-p95-supine"]

[[factors]]
name = "along"
key = "phantom.position_mm[0]"
range = [-60, 60]
relative = true

[[factors]]
name = "yaw"
key = "phantom.head_yaw_deg"
range = [-20, 20]
relative = true
""",
    # An imperfect arm, with motions.
    "dynamic": """
name = "arithmetic"
scenario = {scenarios}/imperfect.toml"
goals = ["right_pleural_lateral"]
engines = ["rapier"]
seed = 3
mode = "dynamic"

[sampling]
method = "sobol"
samples = 1

[[factors]]
name = "across"
key = "phantom.position_mm[1]"
range = [-20, 20]
relative = true
""",
}


class Machine:
    def __init__(self, name: str, program: Path, prefix: tuple[str, ...] = (), plain: bool = False) -> None:
        self.name = name
        self.is_emulated = bool(prefix)
        # Minutes where it is emulated: on the machine that differs most.
        self.moves = name != "Haswell"
        self.command = [*prefix, str(program)]
        self.environment = {**os.environ, **({"GLIBC_TUNABLES": PLAIN} if plain else {})}

    def run(self, *arguments: str | Path) -> None:
        command = [*self.command, *map(str, arguments)]
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True)
        # 1: a criterion is missed, which is a result.
        if done.returncode not in (0, 1):
            sys.exit(f"{self.name}: {' '.join(command)}: status {done.returncode}\n{done.stderr}")


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def report_of(path: Path) -> str:
    report = json.loads(path.read_text())
    del report["timings"]
    return hashlib.sha256(json.dumps(report, sort_keys=True).encode()).hexdigest()


def study(folder: Path, mode: str) -> Path:
    file = folder / f"{mode}.toml"
    scenarios = json.dumps(str(TOP / "scenarios"))[:-1]
    file.write_text(STUDIES[mode].format(scenarios=scenarios))
    return file


def results(machine: Machine, folder: Path) -> dict[str, str]:
    """Hashes of everything that is compared, by what it is."""
    out = folder / machine.name.replace(" ", "_")
    found = {}
    for mode in STUDIES if machine.moves else ["static"]:
        file = study(folder, mode)
        machine.run("study", file, "--out", out / mode, "--quiet", "--yes", "--no-page", "--csv")
        found[f"study, {mode}: table"] = sha256(out / mode / "arithmetic/results.parquet")
        found[f"study, {mode}: CSV"] = sha256(out / mode / "arithmetic/results.csv")
    # Minutes where it is emulated.
    if not machine.is_emulated:
        scenario = TOP / "scenarios/imperfect.toml"
        flags = ("--engine", "rapier", "--no-page", "--no-pictures", "--quiet")
        machine.run("run", scenario, "--out", out / "run", *flags)
        [report] = (out / "run").rglob("report.json")
        found["imperfect arm in rapier: report"] = report_of(report)
        recordings = sorted((out / "run").rglob("*.csv"))
        together = "".join(sha256(path) for path in recordings)
        found[f"imperfect arm in rapier: {len(recordings)} recordings"] = hashlib.sha256(together.encode()).hexdigest()
    return found


def imported(program: Path) -> set[str]:
    """Elementary functions that a program takes from the C library."""
    listed = subprocess.run(["nm", "--dynamic", "--undefined-only", program], capture_output=True, text=True)
    names = {re.sub("@.*", "", line.split()[-1]) for line in listed.stdout.splitlines() if line.strip()}
    return names & ELEMENTARY


def variants_differ() -> bool:
    """Whether switching variants of the C library off does anything on this machine."""
    code = (
        "import hashlib, math; f = [math.sin, math.cos, math.tan, math.atan, math.exp];"
        "print(hashlib.sha256(repr([g(k * 0.001) for g in f for k in range(20000)]).encode()).hexdigest())"
    )
    found = {
        subprocess.run(
            [sys.executable, "-c", code], env={**os.environ, **more}, capture_output=True, text=True, check=True
        ).stdout
        for more in ({}, {"GLIBC_TUNABLES": PLAIN})
    }
    return len(found) == 2


def shards(machines: list[Machine], whole: str, folder: Path) -> None:
    """Every shard on another machine, put together on the first."""
    file = study(folder, "static")
    parts = []
    for part, machine in enumerate(machines, start=1):
        out = folder / f"shard_{part}"
        shard = f"{part}/{len(machines)}"
        machine.run("study", file, "--out", out, "--shard", shard, "--quiet", "--yes")
        parts.append(out / "arithmetic")
    machines[0].run("merge", file, *parts, "--out", folder / "merged", "--quiet", "--no-page")
    if sha256(folder / "merged/arithmetic/results.parquet") != whole:
        sys.exit("shards of unlike machines: the table has other bytes than that of one process")
    names = ", ".join(machine.name for machine in machines)
    print(f"shards of {names}: merged to the bytes of one process")


def numbers(value: object, path: str = "") -> dict[str, object]:
    if isinstance(value, dict):
        return {k: v for key, each in value.items() for k, v in numbers(each, f"{path}.{key}").items()}
    if isinstance(value, list):
        return {k: v for key, each in enumerate(value) for k, v in numbers(each, f"{path}[{key}]").items()}
    return {path: value}


def mujoco(program: Path, folder: Path) -> None:
    """What cannot be made equal, counted."""
    reports = []
    for machine in (Machine("as it is", program), Machine("plain", program, plain=True)):
        out = folder / f"mujoco_{machine.name.replace(' ', '_')}"
        scenario = TOP / "scenarios/imperfect.toml"
        machine.run("run", scenario, "--out", out, "--engine", "mujoco", "--no-page", "--no-pictures", "--quiet")
        [report] = out.rglob("report.json")
        report = json.loads(report.read_text())
        del report["timings"]
        reports.append(numbers(report))
    one, other = reports
    differing = [key for key in one if one[key] != other.get(key)]
    tips = [key for key in differing if key.endswith("_m") and isinstance(one[key], float)]
    most = max((abs(one[key] - other[key]) for key in tips), default=0.0)
    print(
        f"MuJoCo, variants of the C library switched off: {len(differing)} of {len(one)} values differ, "
        f"lengths by {most:.1e} m at most"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--static", type=Path, help="the program linked to another C library")
    parser.add_argument("--mujoco", action="store_true", help="count what differs in MuJoCo")
    parser.add_argument("--require-emulator", action="store_true", help="fail where there is no qemu-user")
    options = parser.parse_args()
    program = options.program.resolve()

    taken = imported(program)
    if taken:
        sys.exit(f"the program takes from the C library: {', '.join(sorted(taken))}")
    print("the program takes no elementary function from the C library")

    native = Machine("this processor", program)
    others = [Machine("plain C library", program, plain=True)]
    if not variants_differ():
        print("switching variants of this machine's C library off changes nothing in it: that case shows nothing here")
    emulator = shutil.which("qemu-x86_64-static") or shutil.which("qemu-x86_64")
    if emulator:
        others += [Machine(cpu, program, (emulator, "-cpu", cpu)) for cpu in ("Nehalem", "Haswell")]
    elif options.require_emulator:
        sys.exit("there is no qemu-x86_64 (Debian's qemu-user-static)")
    else:
        print("emulated processors are skipped: there is no qemu-x86_64 (Debian's qemu-user-static)")
    if options.static:
        others.append(Machine("static program", options.static.resolve()))

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        expected = results(native, folder)
        failed = False
        for machine in others:
            found = results(machine, folder)
            differing = [what for what in found if found[what] != expected.get(what)]
            for what in differing:
                print(f"{machine.name}: {what}: other bytes", file=sys.stderr)
            failed |= bool(differing)
            print(f"{machine.name}: {len(found) - len(differing)} of {len(found)} the same")
        if failed:
            sys.exit("results depend on the processor")
        shards([native, *others], expected["study, static: table"], folder)
        if options.mujoco:
            mujoco(program, folder)


if __name__ == "__main__":
    main()

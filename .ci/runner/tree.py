"""The checkout: its files, what they hold, and which of them a check depends on."""

from __future__ import annotations

import functools
import hashlib
import json
import re
import subprocess
import tomllib
from dataclasses import dataclass
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent.parent
# A record of a check is no input of it, and neither are marks and what tells the change in words.
NEVER_INPUTS = {".ci/evidence.lock", ".ci/marks.lock"}
# Of a crate that another is built with: its tests, benches and examples have no part in it.
NOT_BUILT_IN = re.compile(r"^(tests|benches|examples)/|^README\.md$|^public-api\.txt$")


# Figures that a document takes from the records are no input of what they are the result of.
FIGURE = re.compile(r"<!-- ([\w-]+)\.(\w+) (\S+) -->(.*?)<!-- -->")


class MistakeError(Exception):
    """A mistake in a file of the checks, in words for whoever wrote it."""


def output(*command: str) -> str:
    return subprocess.run(command, cwd=TOP, check=True, stdout=subprocess.PIPE, text=True).stdout


@functools.cache
def files() -> dict[str, str]:
    """SHA-256 of every file that is committed or could be, by its path from the top."""
    listed = output("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard")
    found: dict[str, str] = {}
    for name in sorted(set(filter(None, listed.split("\0"))) - NEVER_INPUTS):
        path = TOP / name
        if path.is_symlink():
            found[name] = digest(str(path.readlink()).encode())
        elif path.is_file():
            held = path.read_bytes()
            if name.endswith(".md"):
                held = FIGURE.sub("", held.decode()).encode()
            found[name] = digest(held)
    return found


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def digest_of(listing: dict[str, str]) -> str:
    return digest("".join(f"{path}\0{held}\n" for path, held in sorted(listing.items())).encode())


@functools.cache
def pattern(words: str) -> re.Pattern[str]:
    """`*` is anything but a slash, `**` anything; a path that ends in a slash is all that is below it."""
    if words.endswith("/"):
        words += "**"
    parts = re.split(r"(\*\*/?|\*)", words)
    spelled = {"**/": "(?:.*/)?", "**": ".*", "*": "[^/]*"}
    return re.compile("".join(spelled.get(part, re.escape(part)) for part in parts))


def matching(words: str) -> dict[str, str]:
    """The files of a pattern. That there are none is a mistake: a check depends on what it names."""
    named = pattern(words)
    found = {path: held for path, held in files().items() if named.fullmatch(path)}
    if not found:
        raise MistakeError(f"`{words}` names no file")
    return found


@dataclass(frozen=True)
class Crate:
    """A crate of the workspace."""

    name: str
    folder: str
    uses: frozenset[str]
    uses_in_tests: frozenset[str]


@functools.cache
def crates() -> dict[str, Crate]:
    """By name."""
    described = json.loads(output("cargo", "metadata", "--format-version", "1", "--no-deps", "--offline"))
    ours = {package["name"] for package in described["packages"]}
    found = {}
    for package in described["packages"]:
        folder = Path(package["manifest_path"]).parent.relative_to(TOP).as_posix()
        edges: dict[bool, set[str]] = {False: set(), True: set()}
        for edge in package["dependencies"]:
            if edge["name"] in ours:
                edges[edge["kind"] == "dev"].add(edge["name"])
        found[package["name"]] = Crate(package["name"], folder, frozenset(edges[False]), frozenset(edges[True]))
    return found


def closure(name: str, *, tests: bool) -> set[str]:
    """Names of a crate and of all that it is built from in the workspace, with `tests` of its tests and examples."""
    try:
        first = crates()[name]
    except KeyError:
        raise MistakeError(f"there is no crate `{name}`") from None
    wanted = {name} | (first.uses_in_tests if tests else frozenset())
    open_ends = list(wanted)
    while open_ends:
        for each in crates()[open_ends.pop()].uses:
            if each not in wanted:
                wanted.add(each)
                open_ends.append(each)
    return wanted


def crate_files(name: str, *, examples: bool) -> dict[str, str]:
    folder = crates()[name].folder
    # A crate may lie around others: what is in their folders is theirs.
    inner = [each.folder for each in crates().values() if each.folder.startswith(f"{folder}/")]
    found = {}
    for path, held in files().items():
        if not path.startswith(f"{folder}/") or any(path.startswith(f"{each}/") for each in inner):
            continue
        rest = path.removeprefix(f"{folder}/")
        if NOT_BUILT_IN.search(rest) and not (examples and rest.startswith("examples/")):
            continue
        found[path] = held
    return found


@functools.cache
def lock_entries() -> dict[str, list[dict]]:
    entries: dict[str, list[dict]] = {}
    for each in tomllib.loads((TOP / "Cargo.lock").read_text())["package"]:
        entries.setdefault(each["name"], []).append(each)
    return entries


def locked(names: set[str]) -> str:
    """SHA-256 of the entries of the lock file below these crates, as far as crates of others go."""
    seen: set[tuple[str, str]] = set()
    lines: list[str] = []
    open_ends = [each for name in names for each in lock_entries().get(name, [])]
    while open_ends:
        entry = open_ends.pop()
        key = (entry["name"], entry["version"])
        if key in seen:
            continue
        seen.add(key)
        ours = "source" not in entry
        if not ours:
            lines.append(f"{entry['name']} {entry['version']} {entry.get('checksum', '')}")
        elif entry["name"] not in names:
            continue
        for words in entry.get("dependencies", []):
            name, *version = words.split()
            open_ends += [each for each in lock_entries()[name] if not version or each["version"] == version[0]]
    return digest("\n".join(sorted(lines)).encode())


# What decides about every build.
BUILD_FILES = ("Cargo.toml", "rust-toolchain.toml", ".cargo/config.toml")


def inputs_of_crates(names: list[str], *, examples: bool) -> dict[str, dict[str, str]]:
    """The files that crates are built from, by group."""
    groups: dict[str, dict[str, str]] = {}
    reached: set[str] = set()
    for name in names:
        reached |= closure(name, tests=examples)
    for name in sorted(reached):
        groups[crates()[name].folder] = crate_files(name, examples=examples and name in names)
    if reached:
        groups["Cargo.lock"] = {"Cargo.lock": locked(reached)}
        groups["build"] = {path: files()[path] for path in BUILD_FILES if path in files()}
    return groups

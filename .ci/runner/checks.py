"""`.ci/checks.toml`, read: every check with what it runs and what it depends on."""

from __future__ import annotations

import functools
import os
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from . import tree
from .tree import TOP, MistakeError

FILE = TOP / ".ci/checks.toml"
TIERS = ("quick", "commit", "evidence")
T = TypeVar("T")


@dataclass(frozen=True)
class Environment:
    """A Python environment, made from one file of exact versions."""

    name: str
    requirements: str


@dataclass(frozen=True)
class Build:
    """What is compiled before the checks that need it."""

    name: str
    run: str
    crates: tuple[str, ...] = ()
    examples: bool = False


@dataclass(frozen=True)
class Check:
    """A check, as the file has it."""

    name: str
    title: str
    tier: str
    run: str
    # Patterns of paths; `**` is the whole checkout.
    files: tuple[str, ...] = ()
    # Crates that are compiled within the check, beside those of its builds.
    crates: tuple[str, ...] = ()
    examples: bool = False
    builds: tuple[str, ...] = ()
    environments: tuple[str, ...] = ()
    # Figures to take from what it prints: name with unit, and a pattern with one group.
    figures: dict[str, str] = field(default_factory=dict)
    # It measures time, or starts what listens: nothing runs beside it.
    alone: bool = False
    # Why it cannot be traced, if so.
    untraced: str = ""
    # Other checks whose results it reads.
    after: tuple[str, ...] = ()

    @functools.cached_property
    def inputs(self) -> dict[str, dict[str, str]]:
        """Every file that it depends on with its hash, in groups with names for people."""
        groups: dict[str, dict[str, str]] = {
            "itself": {f".ci/checks.toml {self.name}": tree.digest(repr(self).encode())}
        }
        for name in self.environments:
            path = environments()[name].requirements
            groups[path] = tree.matching(path)
        for each in [self, *(builds()[name] for name in self.builds)]:
            for group, listing in tree.inputs_of_crates(list(each.crates), examples=each.examples).items():
                groups[group] = groups.get(group, {}) | listing
        for words in self.files:
            groups[words] = tree.matching(words)
        for name in self.after:
            groups[f"check {name}"] = {f"check {name}": checks()[name].digest}
        return groups

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 of all that it depends on."""
        return tree.digest_of(
            {f"{group}\0{path}": held for group, each in self.inputs.items() for path, held in each.items()}
        )

    def group_digests(self) -> dict[str, str]:
        """Of each group, short: to say where a change is."""
        return {group: tree.digest_of(listing)[:12] for group, listing in sorted(self.inputs.items())}

    @property
    def paths(self) -> set[str]:
        return {path for listing in self.inputs.values() for path in listing}


@functools.cache
def document() -> dict:
    return tomllib.loads(FILE.read_text())


def made(kind: type[T], section: str, name: str, given: dict) -> T:
    values = {key: tuple(value) if isinstance(value, list) else value for key, value in given.items()}
    try:
        return kind(name=name, **values)
    except TypeError as error:
        raise MistakeError(f"{FILE.relative_to(TOP)}: [{section}.{name}]: {error}") from None


def section(kind: type[T], name: str) -> dict[str, T]:
    return {each: made(kind, name, each, given) for each, given in document().get(name, {}).items()}


@functools.cache
def environments() -> dict[str, Environment]:
    return section(Environment, "environments")


@functools.cache
def builds() -> dict[str, Build]:
    return section(Build, "builds")


@functools.cache
def checks() -> dict[str, Check]:
    """All checks in the order of the file."""
    found = section(Check, "checks")
    for each in found.values():
        where = f"{FILE.relative_to(TOP)}: [checks.{each.name}]"
        if each.tier not in TIERS:
            raise MistakeError(f"{where}: tier `{each.tier}` is none of {', '.join(TIERS)}")
        for names, known in [(each.builds, builds()), (each.environments, environments()), (each.after, found)]:
            for name in names:
                if name not in known:
                    raise MistakeError(f"{where}: there is no `{name}`")
    return found


def target_folder() -> Path:
    return Path(os.environ.get("CARGO_TARGET_DIR") or TOP / "target").absolute()

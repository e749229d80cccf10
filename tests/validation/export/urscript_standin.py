"""A stand-in for the controller of a UR arm: reads a URScript program by a grammar of its own, carries out its
moves, and says where the guide was.

It knows what the exported programs use and refuses everything else: functions without arguments, assignments,
`while`, `if`, calls, numbers, strings, lists and poses. Carried out:

- `movej(q, a=, v=)` by the trapezoid of the leading joint that the manual describes: the joint with the longest
  way has speed `v` and acceleration `a`, the others move along with it, without blending.
- `servoj(q, 0, 0, t, lookahead, gain)`: the joints are at `q` after `t`, straight from where they were: the path of
  the set-points, not the lag of a real arm behind them. The last set-point, for longer, holds it.
- `stopj(a)`, which has to find the arm at rest or as slow as the last two set-points.
- `set_tcp`, `set_payload`, `popup`, `halt`, `get_actual_joint_positions`, `norm`, `sleep`.

The forward kinematics are those of Denavit and Hartenberg with the lengths that Universal Robots publish, typed in here.
Written from the manual and not from the exporter.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

import numpy as np

# d1, a2, a3, d4, d5, d6 (m), of the maker's article on DH parameters.
LENGTHS = {
    "UR3": (0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819),
    "UR5": (0.089159, -0.42500, -0.39225, 0.10915, 0.09465, 0.0823),
    "UR10": (0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922),
    "UR3e": (0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
    "UR5e": (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
    "UR10e": (0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
}


def forward(arm: str, q) -> np.ndarray:
    """Pose of the flange in the controller's base frame, 4 x 4."""
    d1, a2, a3, d4, d5, d6 = LENGTHS[arm]
    rows = (
        (0.0, d1, math.pi / 2),
        (a2, 0.0, 0.0),
        (a3, 0.0, 0.0),
        (0.0, d4, math.pi / 2),
        (0.0, d5, -math.pi / 2),
        (0.0, d6, 0.0),
    )
    pose = np.eye(4)
    for (a, d, alpha), theta in zip(rows, q, strict=True):
        ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
        pose = pose @ np.array(
            [
                [ct, -st * ca, st * sa, a * ct],
                [st, ct * ca, -ct * sa, a * st],
                [0.0, sa, ca, d],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
    return pose


def transform(pose) -> np.ndarray:
    """4 x 4 of a UR pose: position and rotation vector."""
    rotvec = np.asarray(pose[3:], float)
    angle = float(np.linalg.norm(rotvec))
    made = np.eye(4)
    made[:3, 3] = pose[:3]
    if angle > 0.0:
        x, y, z = rotvec / angle
        k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        made[:3, :3] += math.sin(angle) * k + (1.0 - math.cos(angle)) * (k @ k)
    return made


class ScriptError(Exception):
    """The program is none that this stand-in knows."""


TOKEN = re.compile(
    r"""(?P<comment>\#[^\n]*)|(?P<newline>\n)|(?P<space>[ \t]+)
    |(?P<number>(?:\d+\.\d*|\.\d+|\d+)(?:[eE][+-]?\d+)?)
    |(?P<string>"[^"\n]*")|(?P<name>[A-Za-z_]\w*)|(?P<sign>==|!=|<=|>=|[-+*/()\[\],:=<>])""",
    re.VERBOSE,
)
WORDS = {"def", "end", "while", "if", "else", "global", "local", "True", "False", "halt", "p"}


def tokens(text: str):
    at, line = 0, 1
    while at < len(text):
        match = TOKEN.match(text, at)
        if match is None:
            raise ScriptError(f"line {line}: {text[at : at + 20]!r} is no URScript")
        kind = match.lastgroup
        if kind == "newline":
            yield "newline", "\n", line
            line += 1
        elif kind not in ("comment", "space"):
            yield kind, match.group(), line
        at = match.end()
    yield "newline", "\n", line
    yield "eof", "", line


@dataclass
class Parser:
    """Recursive descent into tuples."""

    stream: list = field(default_factory=list)
    at: int = 0

    def peek(self):
        return self.stream[self.at]

    def next(self):
        self.at += 1
        return self.stream[self.at - 1]

    def take(self, text: str):
        kind, found, line = self.next()
        if found != text:
            raise ScriptError(f"line {line}: {text!r} expected, found {found!r}")

    def skip(self):
        while self.peek()[0] == "newline":
            self.at += 1

    def end_of_line(self):
        kind, found, line = self.next()
        if kind != "newline":
            raise ScriptError(f"line {line}: end of line expected, found {found!r}")

    def block(self):
        body = []
        while True:
            self.skip()
            if self.peek()[1] == "end":
                self.take("end")
                return body
            body.append(self.statement())

    def statement(self):
        kind, word, line = self.peek()
        if word == "def":
            self.next()
            name = self.next()[1]
            self.take("(")
            self.take(")")
            self.take(":")
            return ("def", name, self.block(), line)
        if word in ("while", "if"):
            self.next()
            condition = self.expression()
            self.take(":")
            return (word, condition, self.block(), line)
        if word in ("global", "local"):
            self.next()
        kind, name, line = self.next()
        if kind != "name":
            raise ScriptError(f"line {line}: a statement begins with {name!r}")
        if name == "halt":
            return ("halt", line)
        if self.peek()[1] == "=":
            self.next()
            made = ("set", name, self.expression(), line)
        else:
            made = ("call", name, *self.arguments(), line)
        self.end_of_line()
        return made

    def arguments(self):
        self.take("(")
        given, named = [], {}
        while self.peek()[1] != ")":
            if self.peek()[0] == "name" and self.stream[self.at + 1][1] == "=":
                key = self.next()[1]
                self.next()
                named[key] = self.expression()
            elif named:
                raise ScriptError(f"line {self.peek()[2]}: an argument without a name after one with")
            else:
                given.append(self.expression())
            if self.peek()[1] == ",":
                self.next()
        self.take(")")
        return given, named

    def expression(self):
        left = self.term()
        while self.peek()[1] in ("<", ">", "<=", ">=", "==", "!="):
            left = ("binary", self.next()[1], left, self.term())
        return left

    def term(self):
        left = self.unary()
        while self.peek()[1] in ("+", "-", "*", "/"):
            left = ("binary", self.next()[1], left, self.unary())
        return left

    def unary(self):
        kind, text, line = self.next()
        if text == "-":
            return ("binary", "-", ("value", 0.0), self.unary())
        if kind == "number":
            return ("value", float(text))
        if kind == "string":
            return ("value", text[1:-1])
        if text in ("True", "False"):
            return ("value", text == "True")
        if text == "(":
            inner = self.expression()
            self.take(")")
            return inner
        if text == "[" or (text == "p" and self.peek()[1] == "["):
            if text == "p":
                self.next()
            items = []
            while self.peek()[1] != "]":
                items.append(self.expression())
                if self.peek()[1] == ",":
                    self.next()
            self.take("]")
            return ("list", items)
        if kind != "name" or text in WORDS:
            raise ScriptError(f"line {line}: {text!r} is no value")
        if self.peek()[1] == "(":
            return ("call", text, *self.arguments(), line)
        if self.peek()[1] == "[":
            self.next()
            index = self.expression()
            self.take("]")
            return ("item", text, index)
        return ("name", text)


@dataclass
class Move:
    """What a move did: joint positions at fractions or times."""

    kind: str
    start: np.ndarray
    end: np.ndarray
    duration_s: float
    speed_rad_s: float = 0.0
    acceleration_rad_s2: float = 0.0
    set_points: list = field(default_factory=list)
    period_s: float = 0.0
    settle_s: float = 0.0

    def at_share(self, share: float) -> np.ndarray:
        """Of a `movej` where the leading joint has done this share of its way."""
        return self.start + share * (self.end - self.start)

    def at_time(self, time_s: float) -> np.ndarray:
        if self.kind == "movej":
            return self.at_share(self.share(time_s))
        points = [self.start, *self.set_points]
        place = min(max(time_s / self.period_s, 0.0), len(points) - 1.0)
        k = min(int(place), len(points) - 2)
        return points[k] + (place - k) * (points[k + 1] - points[k])

    def share(self, time_s: float) -> float:
        """Share of the way of a trapezoid."""
        way = float(np.max(np.abs(self.end - self.start)))
        if way == 0.0:
            return 1.0
        a, half = self.acceleration_rad_s2, 0.5 * self.duration_s
        top = min(self.speed_rad_s, math.sqrt(a * way))
        ramp = top / a

        def first(t: float) -> float:
            return 0.5 * a * t * t if t < ramp else top * (t - 0.5 * ramp)

        t = min(max(time_s, 0.0), self.duration_s)
        return (first(t) if t <= half else way - first(self.duration_s - t)) / way


class Halt(Exception):
    """The program ended itself."""


class Controller:
    """Carries a program out from where its joints stand."""

    def __init__(self, q) -> None:
        self.q = np.asarray(q, float)
        self.moves: list[Move] = []
        self.tcp = np.eye(4)
        self.payload = None
        self.popups: list[tuple[str, bool]] = []
        self.values: dict = {}
        self.functions: dict = {}
        self.halted = False

    def run(self, text: str) -> None:
        parser = Parser(list(tokens(text)))
        parser.skip()
        program = parser.statement()
        parser.skip()
        if program[0] != "def" or parser.peek()[0] != "eof":
            raise ScriptError("a program is one function")
        try:
            self.body(program[2])
        except Halt:
            self.halted = True

    def body(self, statements) -> None:
        for each in statements:
            match each:
                case ("def", name, body, _):
                    self.functions[name] = body
                case ("set", name, value, _):
                    self.values[name] = self.value(value)
                case ("while", condition, body, _):
                    while self.value(condition):
                        self.body(body)
                case ("if", condition, body, _):
                    if self.value(condition):
                        self.body(body)
                case ("halt", _):
                    raise Halt
                case ("call", name, given, named, line):
                    self.call(name, given, named, line)
                case _:
                    raise ScriptError(f"{each[0]} is not known")

    def value(self, of):
        match of:
            case ("value", value):
                return value
            case ("name", name):
                return self.values[name]
            case ("item", name, index):
                return self.values[name][round(self.value(index))]
            case ("list", items):
                return [self.value(each) for each in items]
            case ("call", name, given, named, line):
                return self.call(name, given, named, line)
            case ("binary", sign, left, right):
                a, b = self.value(left), self.value(right)
                return {
                    "+": lambda: a + b,
                    "-": lambda: a - b,
                    "*": lambda: a * b,
                    "/": lambda: a / b,
                    "<": lambda: a < b,
                    ">": lambda: a > b,
                    "<=": lambda: a <= b,
                    ">=": lambda: a >= b,
                    "==": lambda: a == b,
                    "!=": lambda: a != b,
                }[sign]()
        raise ScriptError(f"{of[0]} is no value")

    def call(self, name, given, named, line):
        if name in self.functions:
            if given or named:
                raise ScriptError(f"line {line}: {name} has no arguments")
            return self.body(self.functions[name])
        values = [self.value(each) for each in given]
        options = {key: self.value(each) for key, each in named.items()}
        known = {
            "movej": self.movej,
            "servoj": self.servoj,
            "stopj": self.stopj,
            "set_tcp": self.set_tcp,
            "set_payload": self.set_payload,
            "popup": self.popup,
            "sleep": lambda seconds: None,
            "norm": abs,
            "get_actual_joint_positions": lambda: list(self.q),
        }
        if name not in known:
            raise ScriptError(f"line {line}: {name} is not known")
        return known[name](*values, **options)

    def movej(self, q, a=1.4, v=1.05, t=0.0, r=0.0):
        if t != 0.0 or r != 0.0:
            raise ScriptError("movej with a time or a blend")
        end = np.asarray(q, float)
        way = float(np.max(np.abs(end - self.q)))
        ramp = v / a
        duration = way / v + ramp if way >= v * ramp else 2.0 * math.sqrt(way / a)
        self.moves.append(Move("movej", self.q, end, duration, v, a))
        self.q = end

    def servoj(self, q, a=0.0, v=0.0, t=0.002, lookahead_time=0.1, gain=300):
        if not (0.03 <= lookahead_time <= 0.2 and 100 <= gain <= 2000):
            raise ScriptError("lookahead_time or gain outside of what the manual allows")
        end = np.asarray(q, float)
        last = self.moves[-1] if self.moves else None
        if last is not None and last.kind == "servoj" and t > last.period_s and np.array_equal(end, last.end):
            # The last set-point is held, for the arm to catch up.
            last.settle_s += t
            return
        if last is None or last.kind != "servoj" or last.end is not self.q:
            last = Move("servoj", self.q, end, 0.0, period_s=t)
            self.moves.append(last)
        if t != last.period_s:
            raise ScriptError("servoj changes its period")
        last.set_points.append(end)
        last.end, self.q = end, end
        last.duration_s = t * len(last.set_points)

    def stopj(self, a):
        last = self.moves[-1]
        points = [last.start, *last.set_points]
        speed = float(np.max(np.abs(points[-1] - points[-2]))) / last.period_s
        if speed > 0.05:
            raise ScriptError(f"stopj at {speed} rad/s: the arm would leave its path")
        # The stream ends: what follows is another move.
        self.q = np.array(last.end)

    def set_tcp(self, pose):
        self.tcp = transform(pose)

    def set_payload(self, mass, cog=(0.0, 0.0, 0.0)):
        self.payload = (mass, tuple(cog))

    def popup(self, text, title="", warning=False, error=False, blocking=False):
        self.popups.append((text, error))

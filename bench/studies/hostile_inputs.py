"""Inputs that mean harm, drawn from a number alone: what is in the files of a mission or in their
place, or on a command line. `bench/hostile.py` judges many of them, `tests/test_hostile.py` a few.

An input is a folder of files and the arguments of `kybflow`. Judged is what a person would see: no
traceback, an exit code that the help names, an answer in time.
"""

from __future__ import annotations

import contextlib
import copy
import json
import os
import random
import re
import shutil
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any, NamedTuple

import yaml
from command_lines import commands
from toolchain import ROOT

FOLDER = ROOT / "missions"
MISSIONS = sorted(FOLDER.glob("*.yaml"))
LIBRARIES = sorted((FOLDER / "library").glob("*.yaml"))
TABLES = sorted(FOLDER.glob("*/*.csv"))
TREES = {path: yaml.safe_load(path.read_text(encoding="utf-8")) for path in (*MISSIONS, *LIBRARIES)}

USES_FILES = """kybflow: 1
mission: files
import: {own: own.yaml}
world:
  fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}
  tags: {floor: {file: tags.csv}}
  obstacles:
    heap: {point_cloud: {file: scan.xyz, radius: 5 cm}}
    walls: {occupancy: {file: map.yaml, height: 1 m}}
inputs:
  stick: {use: script, file: stick.csv}
  pad: {use: gamepad, controllers: pads.csv}
  hand: {use: haptic, device: simulated, hand: stick.csv}
vehicles:
  a:
    like: own.tagged
    behaviors:
      up:   {do: take_off, height: 1 m, then: way}
      way:  {do: follow_trajectory, file: way.csv, then: down, failed: down}
      down: {do: land}
targets:
  replay: {a: {driver: sim, sensors: {tag_camera: {use: camera, video: standing.avi}}}}
"""
FILES = {
    "mission.yaml": USES_FILES,
    "own.yaml": """library: own
import: {std: kybflow/airframes}
vehicles:
  tagged:
    like: std.nano_plus
    airframe: {like: std.nano_plus, cameras: {down: {calibration: cam.yaml, at: [0, 0, 0]}}}
    estimators: [mocap, tag_camera]
""",
    "tags.csv": """family, id, size [m], x, y, z, heading [deg]
36h11, 0, 0.2, 0, 0, 0, 0
36h11, 1, 0.2, 1, 0, 0, 0
""",
    "way.csv": "t, x, y, z\n0, 0, 0, 1\n8, 1, 0, 1\n",
    "stick.csv": "t, x, y, z, turn, buttons\n0, 0, 0, 0, 0,\n9.0, 0, 0, 0, 0, a\n",
    "pads.csv": "controller, axis, source, low, centre, high\npad, x, left_x, -1, 0, 1\n",
    "scan.xyz": "1.5 1.5 0.2\n1.6 1.5 0.2\n",
    "map.yaml": """image: map.pgm
resolution: 0.5
origin: [-2, -2, 0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.2
""",
    "map.pgm": "P2\n2 2\n255\n255 0\n255 255\n",
    "cam.yaml": """image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}
""",
    "standing.avi": "no video",
}
"""A mission that refers to files of each kind, and these files."""

WORDS = (
    "", " ", "~", "null", "true", "yes", "0", "-1", "1e999", "-1e308", "9" * 400, "0x1F", "1_000",
    ".nan", ".inf", "nan", "inf", "1,5 m", "1.2.3 m", "1 m", "-3 cm", "1e30 km", "300 ms", "20 deg",
    "\u22121 m", "1\u00a0m", "\uff11 m", "m/s\u00b2", "world.points.pad", "world.points.", "world",
    "$x", "$", "$$", "$lap", "std.", "std.mk_quadro", ".", "..", "a.b", "a.b.c.d.e", "a.", ".a",
    "chain.", "chain.x", "end", "hover", "brake", "fault", "land_blind", "landed", "a", "all a",
    "any.landed", "operator.go", "x@2s", "@", "x=1", "=", "x=", "a" * 5000, "a" * 100_000,
    "(" * 300, "[" * 60, "{", "not " * 200 + "x", "state.altitude > 1 m", "a and", "distance(a to",
    "always", "max(", "\x00", "\x1b[2J", "\u2028", "\ud800", "\U0001f600", "\ufeff", "%s%s%n",
    "{vehicle}", "{0.__class__}", "{", "../no.yaml", "/dev/null", "loop", "library",
    "mission.yaml", "no.yaml", "way.csv", "!!python/name:os.system", "*a", "&a", "<<", "- a", "# x",
)  # fmt: skip
KEYS = (
    "do", "use", "as", "like", "stack", "then", "next", "failed", "within", "for", "when", "event",
    "go", "on", "at", "inject", "from", "to", "run", "set", "give", "with", "import", "begin",
    "phases", "otherwise", "type", "default", "at_least", "help", "all", "driver", "sensors",
    "file", "position", "height", "world.points.pad", "std.x", "1", "", "a b", "\u00e9", "then:",
)  # fmt: skip
NOISE = "[]{}:,-&*!|>'\"%@`#?$ \n\tabz019.\u00e9\x85\u2028\x00\u2212\uff1a"


Made = Callable[[Path], object]
"""Makes what stands at a path; the object that it returns, if any, is closed afterwards."""


class Hostile(NamedTuple):
    """One input. kind: how it was drawn. files: the contents of each, or what makes it. arguments:
    what `kybflow` is given, in a folder with these files."""

    kind: str
    files: Mapping[str, bytes | Made]
    arguments: tuple[str, ...]


def drawn(number: int) -> Hostile:
    """The input of a number."""
    chance = random.Random(number)
    kind = chance.choices([*_KINDS], [weight for weight, _ in _KINDS.values()])[0]
    return _KINDS[kind][1](chance)


def lay_out(folder: Path) -> None:
    """Fill a folder in which inputs are tried: the shipped libraries and tables, and a loop."""
    for path in FOLDER.iterdir():
        if path.is_dir():
            shutil.copytree(path, folder / path.name)
    (folder / "loop").symlink_to("loop")


@contextmanager
def laid(one: Hostile, folder: Path) -> Iterator[None]:
    """Put the files of an input into a folder. At the end, what was there before is there again."""
    with ExitStack() as undo:
        for name, data in one.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.exists():
                undo.callback(path.write_bytes, path.read_bytes())
                path.unlink()
            undo.callback(_remove, path)
            if isinstance(data, bytes):
                path.write_bytes(data)
            elif (made := data(path)) is not None:
                undo.callback(made.close)
        yield


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        path.rmdir()
    else:
        path.unlink(missing_ok=True)


def _leads_to(target: str) -> Made:
    return lambda path: path.symlink_to(target)


def _pipe_that_never_ends(path: Path) -> IO[bytes]:
    """A pipe with a writer, which has bytes and no end."""
    os.mkfifo(path)
    stream = open(path, "r+b", buffering=0)  # noqa: SIM115 - closed with the input
    stream.write(b"0 0 0\n" * 5000)
    return stream


def _socket(path: Path) -> socket.socket:
    listener = socket.socket(socket.AF_UNIX)
    with contextlib.chdir(path.parent):  # the whole path may be too long for a socket
        listener.bind(path.name)
    return listener


def _huge(size: int) -> Made:
    def made(path: Path) -> None:
        path.touch()
        os.truncate(path, size)

    return made


def _forbidden(path: Path) -> None:
    path.touch()
    path.chmod(0)


NOT_FILES: tuple[Made, ...] = (
    os.mkfifo, _pipe_that_never_ends, _socket, Path.mkdir, _forbidden,
    *map(_leads_to, (
        "/dev/zero", "/dev/urandom", "/dev/null", "/dev/full", "/dev/tty", "/proc/self/mem",
        "/proc/self/maps", "library", ".", "loop", "nowhere", "mission.yaml", "own.yaml",
    )),
    *map(_huge, (0, 1, 3_999_999, 4_000_001, 300 << 20, 1 << 40)),
)  # fmt: skip
"""What may stand in the place of a file: what doesn't end, can't be read or is too large."""
ENCODINGS = ("utf-16", "utf-16-le", "utf-32", "utf-7", "utf-8-sig", "cp037")
NAMES = (
    "a\0b", "\0", "", " ", ".", "..", "/", "~", "~/x", "x/", "way.csv/x", "a" * 300, "a/" * 3000,
    "\u202eway.csv", "w\u00e4y.csv", "wa\u0308y.csv", "\n", "\x1b[2J", "%00", "$HOME/x", "\ud800",
    "\udcff.csv", "file:///etc/passwd", "http://127.0.0.1/x", "C:\\x.csv", "CON", "-", "--help",
    "/dev/stdin", "/dev/fd/0", "/dev/zero", "/dev/urandom", "/proc/self/fd/1", "/proc/self/mem",
    "/proc/self/cmdline", "/proc/1/mem", "/etc/shadow", "loop", "loop/x", "library", "mission.yaml",
)  # fmt: skip


def _other_file(chance: random.Random) -> Hostile:
    """Something else in the place of a file that a mission refers to, or another name of it."""
    files: dict[str, bytes | Made] = {name: text.encode() for name, text in FILES.items()}
    name, what = chance.choice([*FILES]), chance.random()
    data = FILES[name].encode()
    if what < 0.5:
        files[name] = chance.choice(NOT_FILES)
    elif what < 0.65:
        broken = [data[: chance.randrange(len(data))], data + chance.randbytes(9), data * 2000]
        files[name] = chance.choice([*broken, chance.randbytes(chance.randint(1, 3000))])
    elif what < 0.75:
        files[name] = FILES[name].encode(chance.choice(ENCODINGS))
    elif what < 0.95:
        where = "own.yaml" if name == "cam.yaml" else "map.yaml" if name == "map.pgm" else None
        text = FILES[where or "mission.yaml"]
        quoted = json.dumps(chance.choice(NAMES))
        files[where or "mission.yaml"] = text.replace(name, quoted).encode()
    else:
        files = {os.fsdecode(b"\xff\xfe") + name: data for name, data in files.items()}
    mission = next(path for path in files if path.endswith("mission.yaml"))
    return Hostile("file", files, (*chance.choice(_ON_FILES), mission))


_ON_FILES = (
    *[("validate",)] * 12, ("show", "--resolved"), ("graph",), ("validate", "--format", "json"),
    ("show", "--target", "replay"), ("library",), ("run",),
    ("calibrate", "--frames", "standing.avi", "--poses", "way.csv", "--vehicle", "a"),
    ("validate", "--target", "replay"),
)  # fmt: skip


_OTHERS = (
    ("validate", "--format", "json"), ("validate", "--format", "sarif"),
    ("validate", "--format", "github"), ("show", "--resolved"), ("graph",),
)  # fmt: skip


def _of_mission(kind: str, data: bytes, chance: random.Random, **more: bytes) -> Hostile:
    command = chance.choice([("validate",)] * 6 + [*_OTHERS])
    return Hostile(kind, {"mission.yaml": data, **more}, (*command, "mission.yaml"))


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


def _noise_in_bytes(chance: random.Random) -> Hostile:
    data = bytearray(chance.choice(MISSIONS).read_bytes())
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(len(data) + 1)
        data[at : at + chance.randint(0, 4)] = chance.randbytes(chance.randint(0, 4))
    return _of_mission("bytes", bytes(data), chance)


def _noise_in_text(chance: random.Random) -> Hostile:
    text = chance.choice(MISSIONS).read_text(encoding="utf-8")
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(text) + 1)
        put = "".join(chance.choices(NOISE, k=chance.randint(0, 6)))
        text = text[:at] + put + text[at + chance.randint(0, 8) :]
    return _of_mission("text", _encoded(text), chance)


_WORD = re.compile(r"[\w.$%/-]+")


def _other_words(chance: random.Random) -> Hostile:
    """Values and names of a mission's text, each in turn another: the layout stays."""
    text = chance.choice(MISSIONS).read_text(encoding="utf-8")
    for _ in range(chance.randint(1, 3)):
        word = chance.choice([*_WORD.finditer(text)])
        text = text[: word.start()] + chance.choice(WORDS) + text[word.end() :]
    return _of_mission("words", _encoded(text), chance)


def _other_tree(chance: random.Random) -> Hostile:
    tree = changed(TREES[chance.choice(MISSIONS)], chance)
    return _of_mission("tree", dumped(tree), chance)


def _other_library(chance: random.Random) -> Hostile:
    path = chance.choice(LIBRARIES)
    library = dumped(changed(TREES[path], chance))
    mission = chance.choice(MISSIONS).read_bytes()
    if chance.random() < 0.3:
        return Hostile("library", {f"library/{path.name}": library}, ("validate", "library"))
    return Hostile(
        "library",
        {f"library/{path.name}": library, "mission.yaml": mission},
        ("validate", "mission.yaml"),
    )


def _other_table(chance: random.Random) -> Hostile:
    files = dict(FILES)
    name = chance.choice([*files])
    for _ in range(chance.randint(1, 3)):
        text = files[name]
        words = [*_WORD.finditer(text)]
        if chance.random() < 0.6 and words:
            word = chance.choice(words)
            files[name] = text[: word.start()] + chance.choice(WORDS) + text[word.end() :]
        else:
            at = chance.randrange(len(text) + 1)
            put = "".join(chance.choices(NOISE, k=3))
            files[name] = text[:at] + put + text[at + chance.randint(0, 9) :]
    more = {key: _encoded(text) for key, text in files.items()}
    return _of_mission("table", more.pop("mission.yaml"), chance, **more)


def dumped(tree: Any) -> bytes:
    """A tree as YAML, with anchors where a part of it stands twice."""
    return _encoded(yaml.safe_dump(tree, allow_unicode=True, sort_keys=False))


def changed(tree: Any, chance: random.Random) -> Any:
    """A tree with up to four changes: parts removed, replaced, renamed, moved elsewhere, shared."""
    tree = copy.deepcopy(tree)
    for _ in range(chance.randint(1, 4)):
        places = [*_places(tree)]
        if not places:
            break
        inside, key = chance.choice(places)
        _change(inside, key, chance, places)
    return tree


def _change(inside: Any, key: Any, chance: random.Random, places: list[tuple[Any, Any]]) -> None:
    what = chance.choice(["value", "value", "value", "remove", "rename", "move", "nest", "add"])
    other, at = chance.choice(places)
    if what == "value":
        inside[key] = odd_value(chance)
    elif what == "remove":
        del inside[key]
    elif what == "rename" and isinstance(inside, dict):
        inside[chance.choice(KEYS + WORDS)] = inside.pop(key)
    elif what == "move":  # an alias, where it is a part of the tree; never inside of itself
        is_shared = chance.random() < 0.5 and _is_flat(other[at])
        inside[key] = other[at] if is_shared else copy.deepcopy(other[at])
    elif what == "nest":
        inside[key] = [inside[key]] if chance.random() < 0.5 else {chance.choice(KEYS): inside[key]}
    elif isinstance(inside, dict):
        inside[chance.choice(KEYS)] = odd_value(chance)
    else:
        inside.insert(key, odd_value(chance))


def _is_flat(value: Any) -> bool:
    """Whether no mapping or list is in it."""
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return not any(isinstance(one, dict | list) for one in inner)


def odd_value(chance: random.Random, depth: int = 0) -> Any:
    """A value of any kind, most of them words."""
    kind = chance.randint(0, 12 if depth < 3 else 9)
    if kind < 8:
        return chance.choice(WORDS)
    if kind == 8:
        return chance.choice([None, True, False, 0, -1, 10**400, 1.5, float("nan"), float("inf")])
    if kind == 9:
        return [chance.choice([0, 1, -1, "1 m", 1e300]) for _ in range(chance.randint(0, 4))]
    if kind == 10:
        return [odd_value(chance, depth + 1) for _ in range(chance.randint(0, 3))]
    return {chance.choice(KEYS): odd_value(chance, depth + 1) for _ in range(chance.randint(0, 3))}


def _places(tree: Any) -> Iterator[tuple[Any, Any]]:
    waiting, seen = [tree], set[int]()
    while waiting:
        top = waiting.pop()
        if id(top) in seen:
            continue
        seen.add(id(top))
        for key in list(top) if isinstance(top, dict) else range(len(top)):
            yield top, key
            if isinstance(top[key], dict | list):
                waiting.append(top[key])


GIVEN = ("mission.yaml", "library", "figure_eight", "lap=8s", "1 m", "mk", "nano", "2s", "KYB104")
NEVER = frozenset({"--help", "--live", "--version"})
"""Options that end a command at once, or open a window."""


def _command_line(chance: random.Random) -> Hostile:
    names, command = chance.choice(COMMANDS_WITH)
    words = [*names]
    for parameter in command.params:
        is_needed = parameter.param_type_name == "argument"
        if is_needed and chance.random() < 0.95:
            count = 1 if parameter.nargs == 1 else chance.randint(1, 3)
            words += [_argument(chance, is_needed) for _ in range(count)]
        elif not is_needed and chance.random() < 0.25:
            words += _option(parameter, chance)
    words = [word.replace("\x00", "") for word in words]  # no command line has one
    return Hostile("command line", {"mission.yaml": _a_mission(chance)}, tuple(words))


def _a_mission(chance: random.Random) -> bytes:
    return chance.choice(MISSIONS).read_bytes()


def _argument(chance: random.Random, is_place: bool) -> str:
    if chance.random() < 0.5:
        return "mission.yaml" if is_place else chance.choice(GIVEN)
    return chance.choice(WORDS)


def _option(parameter: Any, chance: random.Random) -> list[str]:
    name = chance.choice(parameter.opts)
    if name in NEVER:
        return []
    if getattr(parameter, "is_flag", False):
        return [name]
    choices = getattr(parameter.type, "choices", ())
    if choices and chance.random() < 0.5:
        return [name, chance.choice(list(choices))]
    return [name, _argument(chance, is_place=False)]


LASTING = frozenset(
    {"run", "test", "command", "mocap-server", "mavlink", "emulate", "record-input"}
)
"""Commands that go on until they are interrupted, or fly."""


COMMANDS_WITH = [*commands()]
_KINDS: dict[str, tuple[int, Callable[[random.Random], Hostile]]] = {
    "bytes": (5, _noise_in_bytes),
    "text": (10, _noise_in_text),
    "words": (20, _other_words),
    "tree": (30, _other_tree),
    "library": (10, _other_library),
    "table": (10, _other_table),
    "command line": (15, _command_line),
    "file": (15, _other_file),
}
"""The weight of each kind among all inputs, and what draws it."""

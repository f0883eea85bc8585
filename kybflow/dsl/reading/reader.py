"""Read the YAML files of missions: find them in a folder, decode a file, and compose its node tree
with the events of PyYAML's C parser.

PyYAML's own composer is not used because it recurses in C: 20,000 nested brackets would end the
process. The depth is bounded, and so is the number of nodes with every alias expanded. Tags, merge
keys and second documents are refused. Every node has its source location.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
import os
import re
import unicodedata
from pathlib import Path
from typing import Any, NamedTuple, TypeGuard

import yaml
from yaml.events import (
    AliasEvent,
    MappingEndEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
    StreamEndEvent,
)

from kybflow.core.files import NotRegular, read_regular
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import Collector, Diagnostic, Span, has_errors
from kybflow.dsl.reading.nodes import (
    NAME,
    NAME_A_POINT,
    NO_COMMAS,
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    is_cut,
    items_of,
)
from kybflow.dsl.reading.yaml_errors import (
    CLOSE,
    not_yaml,
    strange_characters,
    strange_names,
    without_colon,
)

CODES = {
    "KYB001": "The file can't be opened or is not a regular file.",
    "KYB002": "The file is larger than a mission may be.",
    "KYB003": "The file is not UTF-8 text.",
    "KYB005": "The file is empty.",
    "KYB006": "The file contains more than one document.",
    "KYB007": "A mapping has the same key twice.",
    "KYB008": "The file contains a YAML tag. A mission has only plain values.",
    "KYB009": "The file uses YAML's merge key instead of `like`.",
    "KYB010": "A key is not a plain name.",
    "KYB011": "The file is nested too deep.",
    "KYB012": "The file has too many values, counted with every alias expanded.",
    "KYB013": "An alias is not defined, or contains itself.",
    "KYB015": "A key has no value, which counts as not written.",
}
MAX_NODES = 100_000
MAX_DEPTH = 40
LONG = "a long path belongs in a table of its own, which `do: follow_trajectory` flies"
"""The hint for a file that is too large."""
_SHOWN_LETTERS = 60
_TABS = re.compile(r"^ *\t[ \t]*(?=#|\r?$)", re.MULTILINE)
"""Tabs before a comment or in an empty line, which are YAML, but which its C parser refuses."""
_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Unreadable(Exception):
    """Stops the composing of a text; the reason is already reported."""


def compose(text: str, file: str, found: Collector) -> Node | None:
    """Return the node tree of `text`, or None if it can't be composed; report what is wrong."""
    own, root = Collector(), None
    try:
        root = _Composer(text, file, own).document(_Loader(text))
    except _Unreadable:
        pass  # the reason is reported
    except (yaml.YAMLError, UnicodeError) as error:
        spaced = _TABS.sub(lambda tabs: " " * len(tabs[0]), text)
        if spaced != text:
            return compose(spaced, file, found)
        stopped = not_yaml(error, text, file)
        is_told = any(d.span.line == stopped.span.line for d in own.all if has_errors([d]))
        own.add(() if is_told else stopped)
    found.add(own.all)
    return root


class _Composer:
    """Builds one tree from the parser's events. `_sizes` holds the number of nodes under each
    anchor."""

    def __init__(self, text: str, file: str, found: Collector) -> None:
        self._text, self._file, self._found = text, file, found
        self._anchors: dict[str, Node | None] = {}
        self._sizes: dict[str, int] = {}
        self._total = 0
        self._is_ascii = text.isascii()

    @functools.cached_property
    def _lines(self) -> list[str]:
        return self._text.splitlines()

    def document(self, loader: Any) -> Node:
        self._next_event = loader.get_event
        loader.get_event()
        if loader.check_event(StreamEndEvent):
            hint = "a mission begins with `kybflow: 1` and `mission: NAME`"
            raise self._stopped("KYB005", f"`{self._file}` is empty", loader.get_event(), hint)
        loader.get_event()
        root = self._node(loader.get_event(), 0)
        loader.get_event()
        if not loader.check_event(StreamEndEvent):
            second = loader.get_event()
            hint = "a file holds one mission: remove `---`, or move the rest to a file of its own"
            raise self._stopped("KYB006", "a second document begins here", second, hint)
        return root

    def _node(self, event: Any, depth: int) -> Node:
        if isinstance(event, AliasEvent):
            return self._alias(event)
        self._total += 1
        if depth > MAX_DEPTH:
            message = f"nested deeper than {MAX_DEPTH} levels"
            raise self._stopped("KYB011", message, event, CLOSE)
        if self._total > MAX_NODES:
            raise self._too_many(event)
        if event.tag is not None and event.tag != "!":
            message, span = f"the tag `{event.tag}` is refused", self._span(event, event)
            self._found.report("KYB008", message, span, help="write the value without it")
        anchor = event.anchor
        if anchor is None:
            return self._content(event, depth)
        before, self._anchors[anchor] = self._total, None
        node = self._anchors[anchor] = self._content(event, depth)
        self._sizes[anchor] = self._total - before + 1
        return node

    def _alias(self, event: Any) -> Node:
        name = event.anchor
        node = self._anchors.get(name)
        if node is None:
            inside = f"`*{name}` is inside `&{name}`"
            message = inside if name in self._anchors else f"nothing is marked `&{name}`"
            hint = "write the values out, or correct the name"
            raise self._stopped("KYB013", message, event, hint)
        self._total += self._sizes[name]
        if self._total > MAX_NODES:
            raise self._too_many(event)
        return node

    def _too_many(self, event: Any) -> _Unreadable:
        return self._stopped("KYB012", f"more than {MAX_NODES} values", event, LONG)

    def _content(self, event: Any, depth: int) -> Node:
        if isinstance(event, ScalarEvent):
            return Scalar(event.value, self._span(event, event), event.style not in (None, ""))
        if isinstance(event, SequenceStartEvent):
            items: list[Node] = []
            while not isinstance(inner := self._next_event(), SequenceEndEvent):
                items.append(self._node(inner, depth + 1))
            return Sequence(tuple(items), self._span(event, inner))
        entries: dict[str, MappingEntry] = {}
        bare: list[Scalar] = []
        while not isinstance(inner := self._next_event(), MappingEndEvent):
            key = self._node(inner, depth + 1)
            if entries and not isinstance(key, Scalar):
                self._refuse_cut(next(reversed(entries.values())), key)
            value = self._node(self._next_event(), depth + 1)
            if isinstance(value, Scalar) and not value.text and self._is_bare(key, value):
                bare.append(key)
                continue
            if bare:
                without_colon(next(reversed(entries.values()), None), bare, self._found)
                bare = []
            self._enter(entries, key, value)
        if bare:
            without_colon(next(reversed(entries.values()), None), bare, self._found)
        return Mapping(entries, self._span(event, inner))

    def _is_bare(self, key: Node, value: Scalar) -> TypeGuard[Scalar]:
        """Return whether a key has no colon, such as `5 m` in `{height: 1,5 m}`. A colon without a
        value only gets a warning."""
        if value.quoted or not isinstance(key, Scalar):
            return False
        line = self._lines[key.span.end_line - 1 : key.span.end_line]
        if line and not line[0][key.span.end_column - 1 :].lstrip().startswith(":"):
            return True
        message = f"`{key.text[:_SHOWN_LETTERS]}` has no value"
        hint = (
            "write one, indent what belongs to it, or remove it; `null` removes what `like` brings"
        )
        self._found.warn("KYB015", message, key.span, help=hint)
        return False

    def _refuse_cut(self, before: MappingEntry, key: Node) -> None:
        """Stop if YAML ended a condition at a comma inside its parentheses, because the rest is no
        mapping."""
        if is_cut(before.value):
            message = f"YAML ends `{before.key.text}` at the comma and reads a list as a key"
            self._found.report("KYB010", message, key.span, help=f"{NO_COMMAS}; {NAME_A_POINT}")
            raise _Unreadable

    def _enter(self, entries: dict[str, MappingEntry], key: Node, value: Node) -> None:
        if not isinstance(key, Scalar):
            what = "a list" if isinstance(key, Sequence) else "a mapping"
            self._found.report("KYB010", f"{what} can't be a key", key.span, help="a key is a name")
        elif key.text == "<<" and not key.quoted:
            hint = "start from another entry with `like: NAME`"
            self._found.report("KYB009", "YAML's merge key `<<` is refused", key.span, help=hint)
        elif key.text[-1:] == ":" and not key.quoted and NAME.match(name := key.text.rstrip(": ")):
            hint = f"write `{name}: ...`"
            self._found.report("KYB010", f"`{name}` has two colons", key.span, help=hint)
        elif key.text in entries:
            first, again = entries[key.text].key.span, key.span
            message, hint = f"`{key.text}` is written twice", "remove one of them, or rename it"
            self._found.report("KYB007", message, again, "again", (f"first at {first.at}",), hint)
            self._found.report("KYB007", message, first, "first", (f"again at {again.at}",), hint)
        else:
            if not self._is_ascii:
                strange_characters(key, self._found)
                strange_names(key, value, self._found)
                for item in items_of(value) or (value,):
                    if isinstance(item, Scalar):
                        strange_characters(item, self._found, key.text)
            entries[key.text] = MappingEntry(key, value)

    def _stopped(self, code: str, message: str, event: Any, help: str = "") -> _Unreadable:
        """Report why composing stops at `event`, and return the exception to raise."""
        self._found.report(code, message, self._span(event, event), help=help)
        return _Unreadable()

    def _span(self, first: Any, last: Any) -> Span:
        start, end = first.start_mark, last.end_mark
        return Span(self._file, start.line + 1, start.column + 1, end.line + 1, end.column + 1)


MAX_BYTES = 2_000_000
MOST_FILES = 200
"""The most files of a folder that are compared with an unknown name."""


class ParsedFile(NamedTuple):
    """A YAML file as read. file: its path as shown in reports. text: its contents. sha256: the
    digest of its bytes. root: its node tree, None if the file can't be read or isn't YAML. found:
    the diagnostics from reading it."""

    file: str
    text: str
    sha256: str
    root: Node | None
    found: tuple[Diagnostic, ...]


def read(path: Path, file: str) -> ParsedFile:
    """Read the file `path`, which reports call `file`."""
    found = Collector()
    data = _bytes_of(path, file, found)
    text = None if data is None else _decode(data, file, found)
    if text is not None and not text.isascii():
        text = unicodedata.normalize("NFC", text)
    root = None if text is None else compose(text, file, found)
    digest = "" if data is None or text is None else hashlib.sha256(data).hexdigest()
    return ParsedFile(file, text or "", digest, root, tuple(found.all))


def _bytes_of(path: Path, file: str, found: Collector) -> bytes | None:
    start = Span(file, 1, 1, 1, 1)
    if not file.isascii() and (byte := next((c for c in file if "\udc80" <= c <= "\udcff"), "")):
        shown = file.encode("utf-8", "backslashreplace").decode()
        message = f"the name of `{shown}` is not UTF-8: byte 0x{ord(byte) & 0xFF:02x}"
        found.report("KYB001", message, start, help="rename the file or its folder")
        return None
    try:
        data = read_regular(path, MAX_BYTES)
    except NotRegular:
        found.report("KYB001", f"`{file}` is not a file", start, help=_near(path))
        return None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        message = f"`{file}` can't be read: {reason.lower()}"
        found.report("KYB001", message, start, help=_near(path))
        return None
    if len(data) > MAX_BYTES:
        message = f"`{file}` is larger than {MAX_BYTES // 1_000_000} MB"
        found.report("KYB002", message, start, help=LONG)
        return None
    return data


def _near(path: Path) -> str:
    """Return the hint for a missing file: the most similar name in the folder, or an empty
    string."""
    if os.path.exists(path) and not os.path.isdir(path):
        return "give a regular file: a pipe or a device may never end"
    try:
        folder = path if os.path.isdir(path) else path.parent
        names = [str(folder / f.name) for f in itertools.islice(folder.glob("*.yaml"), MOST_FILES)]
    except (OSError, ValueError):
        return ""
    return did_you_mean(str(path), names)


def _decode(data: bytes, file: str, found: Collector) -> str | None:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start]
        line = before.count(b"\n") + 1
        column = len(before[before.rfind(b"\n") + 1 :].decode("utf-8", "replace")) + 1
        message = f"`{file}` is not UTF-8: byte 0x{data[error.start]:02x}"
        place = Span(file, line, column, line, column + 1)
        found.report("KYB003", message, place, help="save it as UTF-8")
        return None


RESOLVED, PROVENANCE = "mission.resolved.yaml", "provenance.json"
"""The files that every run folder contains."""
_KEY = re.compile(r"""(["']?)(?:kybflow|mission|library)\1\s*:""")


def mission_files(folder: Path) -> list[Path]:
    """Return the missions and libraries in `folder` and its subfolders, sorted: the YAML files with
    a top-level key `kybflow`, `mission` or `library`, even if they are invalid. Hidden subfolders
    and run folders are skipped."""
    found: list[Path] = []
    for where, folders, files in os.walk(folder):
        here = Path(where)
        if here != folder and not {RESOLVED, PROVENANCE}.isdisjoint(files):
            folders.clear()
            continue
        folders[:] = [name for name in folders if not name.startswith(".")]
        paths = (here / name for name in files if Path(name).suffix in (".yaml", ".yml"))
        found += filter(_is_ours, paths)
    return sorted(found)


def _is_ours(path: Path) -> bool:
    """Return whether a file has such a key at the top level, or can't be read: an unreadable file
    is reported when it is opened."""
    try:
        data = read_regular(path, MAX_BYTES)
    except OSError:
        return True
    # NUL and invalid bytes are dropped so that UTF-16 is found here and refused by the reader
    text = data.replace(b"\0", b"").decode("utf-8", "ignore").lstrip("\ufeff")
    lines = [line for line in text.splitlines() if line.strip() and line.lstrip()[0] not in "#%-"]
    if not lines:
        return False
    if lines[0].lstrip().startswith("{"):
        return _KEY.search(text) is not None
    margin = len(lines[0]) - len(lines[0].lstrip())
    return any(_KEY.match(line, margin) for line in lines if not line[:margin].strip())

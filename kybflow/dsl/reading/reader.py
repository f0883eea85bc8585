"""Read a file: open it, check its size, decode it and compose its node tree."""

from __future__ import annotations

import hashlib
import itertools
import os
import stat
from pathlib import Path
from typing import NamedTuple

from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Findings
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.reading.composer import LONG, compose
from kybflow.dsl.reading.nodes import Node

CODES = {
    "KYB001": "The file can't be opened or is no regular file.",
    "KYB002": "The file is larger than a mission may be.",
    "KYB003": "The file is not UTF-8 text.",
}
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
    found = Findings()
    data = _bytes_of(path, file, found)
    text = None if data is None else _decode(data, file, found)
    root = None if text is None else compose(text, file, found)
    digest = "" if data is None or text is None else hashlib.sha256(data).hexdigest()
    return ParsedFile(file, text or "", digest, root, tuple(found.all))


def _bytes_of(path: Path, file: str, found: Findings) -> bytes | None:
    start = Span(file, 1, 1, 1, 1)
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            found.report("KYB001", f"`{file}` is not a file", start, help=_near(path))
            return None
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
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
    try:
        folder = path if os.path.isdir(path) else path.parent
        names = [str(folder / f.name) for f in itertools.islice(folder.glob("*.yaml"), MOST_FILES)]
    except (OSError, ValueError):
        return ""
    return did_you_mean(str(path), names)


def _decode(data: bytes, file: str, found: Findings) -> str | None:
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

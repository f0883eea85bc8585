"""Find the missions and libraries in a folder among its YAML files."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path

from kybflow.dsl.reading.reader import MAX_BYTES

RESOLVED, PROVENANCE = "mission.resolved.yaml", "provenance.json"
"""The files that every run folder contains."""
_KEY = re.compile(r"""(["']?)(?:kybflow|mission|library)\1\s*:""")


def mission_files(folder: Path) -> list[Path]:
    """Return the YAML files in `folder` and its subfolders, sorted, that have a key of a mission or
    library at the top level, including invalid ones. Hidden subfolders and run folders are
    skipped."""
    return sorted(path for path in _yaml_files(folder) if _is_ours(path))


def _yaml_files(folder: Path) -> Iterator[Path]:
    for where, folders, files in os.walk(folder):
        here = Path(where)
        if here != folder and not {RESOLVED, PROVENANCE}.isdisjoint(files):
            folders.clear()
            continue
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (here / name for name in files if Path(name).suffix in (".yaml", ".yml"))


def _is_ours(path: Path) -> bool:
    """Return whether the file contains such a key, or can't be read. The reader reports an
    unreadable file."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            return True
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES)
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

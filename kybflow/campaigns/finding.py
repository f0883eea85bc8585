"""Which missions to fly: those named, and those in folders."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from kybflow.dsl.reading.folders import RESOLVED, mission_files
from kybflow.dsl.reading.reader import read
from kybflow.dsl.schema.judge import is_library


def missions_under(paths: Iterable[Path]) -> Iterator[Path]:
    """Each of `paths`; a folder stands for the missions in it and below, without its libraries and
    what runs have left."""
    for path in paths:
        if path.is_dir():
            yield from (p for p in mission_files(path) if p.name != RESOLVED and not _is_library(p))
        else:
            yield path


def _is_library(path: Path) -> bool:
    root = read(path, str(path)).root
    return root is not None and is_library(root)

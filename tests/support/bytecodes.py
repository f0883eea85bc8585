"""Counts the bytecodes that a piece of code executes: a measure of its cost that repeats exactly.

`sys.settrace` with opcode events repeats on Python 3.11 only (3.12 and 3.13 count other numbers,
and not always the same), so every budget holds for that version and its tests skip on others.
"""

from __future__ import annotations

import gc
import os
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import kybflow

TOLERANCE, SLACK = 0.03, 5.0
"""How far a count may exceed its budget: a part of it, and bytecodes for the smallest stages."""

needs_repeatable_counts = pytest.mark.skipif(
    sys.version_info[:2] != (3, 11) or sys.gettrace() is not None,
    reason="opcode traces repeat exactly on Python 3.11, outside debuggers and coverage",
)
_FOLDERS = frozenset(f.__code__.co_filename for f in (os.path.realpath, Path.relative_to))
_PACKAGE = str(Path(kybflow.__file__).parent) + "/"


class Bytecodes:
    """Counts bytecodes between `start` and `stop`, by stage.

    stages: (beginning of a module's path below `kybflow/`, its stage), the first match counts. Code
    that matches none, like geometry or the standard library, belongs to the stage that called it.
    No garbage is collected meanwhile, for what listens to that (Hypothesis) would be counted. What
    goes through the folders of a path isn't, for those are more in a checkout that lies deeper.
    """

    def __init__(self, stages: tuple[tuple[str, str], ...], otherwise: str) -> None:
        self.counts: Counter[str] = Counter()
        self._stages, self._otherwise = stages, otherwise
        self._stage_of: dict[str, str | None] = {}

    def start(self) -> None:
        gc.disable()
        sys.settrace(self._called)

    def stop(self) -> None:
        sys.settrace(None)
        gc.enable()

    def _called(self, frame: FrameType, event: str, argument: Any) -> Any:
        if frame.f_code.co_filename in _FOLDERS:
            return None
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        stage, counts = self._stage(frame), self.counts

        def executed(frame: FrameType, event: str, argument: Any) -> Any:
            if event == "opcode":
                counts[stage] += 1
            return executed

        return executed

    def _stage(self, frame: FrameType | None) -> str:
        while frame is not None:
            stage = self._of(frame.f_code.co_filename)
            if stage is not None:
                return stage
            frame = frame.f_back
        return self._otherwise

    def _of(self, file: str) -> str | None:
        if file not in self._stage_of:
            module = file.removeprefix(_PACKAGE)
            self._stage_of[file] = next((s for p, s in self._stages if module.startswith(p)), None)
        return self._stage_of[file]


def off_budget(counted: Mapping[str, float], budget: Mapping[str, float]) -> list[str]:
    """Return a line for each stage that costs more than its budget and the tolerance, or so much
    less that the budget should be lowered before somebody spends what was saved."""
    lines = []
    for stage in sorted(counted.keys() | budget.keys()):
        found, allowed = counted.get(stage, 0.0), budget.get(stage, 0.0)
        slack = allowed * TOLERANCE + SLACK
        if found > allowed + slack:
            lines.append(f"{stage}: {found:.0f} bytecodes, {allowed:.0f} are budgeted")
        elif found < allowed - 2.0 * slack:
            lines.append(f"{stage}: only {found:.0f} bytecodes; lower its budget of {allowed:.0f}")
    return lines

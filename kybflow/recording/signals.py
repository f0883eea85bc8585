"""The recorded signals of a vehicle or of one of its sensors, as arrays with units.

The fields of a message, their types and their units come from the definition in the recording
itself (`kybflow.recording.layout` writes it), so that a recording says by itself what is in it.
World frame (ENU), body frame (FLU), SI; quaternions (w, x, y, z), body to world.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kybflow.core.errors import KybflowError
from kybflow.core.signals import NS
from kybflow.core.text import did_you_mean
from kybflow.recording.layout import PLAIN
from kybflow.recording.messages import Messages

Array = NDArray[Any]
_UNIT = re.compile(r"(m/s\^3|m/s\^2|m/s|rad/s|rad|m|s|ns|N m|N|kg|V|Hz|%)(?=[ ,;:.(]|$)")
_AXES = ("x", "y", "z"), ("w", "x", "y", "z")
_BITS = ("position", "velocity", "acceleration", "jerk", "heading")
"""The fields of a setpoint that can be missing, in the order of the bits of its `present`."""


class SignalUnknown(KybflowError, KeyError):
    """No signal, sensor or vehicle is called so; the message says which there are."""

    __str__ = Exception.__str__  # KeyError's would quote it


class RecordedField(NamedTuple):
    """A field of a message. name: with those around it, joined by dots. unit: empty for a number, a
    flag or a quaternion. kind: the argument of `numpy.dtype`."""

    name: str
    unit: str
    kind: Any


def fields_of(definition: str) -> list[RecordedField]:
    """Return the fields of a ROS 1 message; vectors and quaternions become one field. Raises
    ValueError for a type that isn't defined."""
    first, *others = re.split(r"^=+\nMSG: ", definition, flags=re.MULTILINE)
    texts = {}
    for other in others:
        name, _, text = other.partition("\n")
        texts[name.rpartition("/")[2]] = text
    return [*_fields(first, texts, "")]


def _fields(text: str, texts: Mapping[str, str], prefix: str) -> Iterator[RecordedField]:
    for line in filter(None, text.splitlines()):
        declared, _, comment = line.partition("#")
        kind, name = declared.split()
        unit = _UNIT.match(comment.strip())
        yield from _field(prefix + name, kind, unit[1] if unit else "", texts)


def _field(name: str, kind: str, unit: str, texts: Mapping[str, str]) -> Iterator[RecordedField]:
    if kind in PLAIN:
        yield RecordedField(name, unit, PLAIN[kind][1])
    elif kind not in texts:
        raise ValueError(f"the recording doesn't define `{kind}`")
    else:
        inner = [*_fields(texts[kind], texts, "")]
        if tuple(one.name for one in inner) in _AXES:
            yield RecordedField(name, unit, (inner[0].kind, (len(inner),)))
        else:
            yield from _fields(texts[kind], texts, f"{name}.")


class Signals(Mapping[str, Array]):
    """Recorded signals by name, such as `estimate.position`: one row for each time. Numbers that
    were not there, such as the position of a vehicle without an estimate, are NaN.

    time: seconds since the start of the run, shape (n,). units: the unit of each signal; empty for
    pure numbers.
    """

    def __init__(self, messages: Messages) -> None:
        fields = fields_of(messages.definition) if messages.definition else []
        kind = np.dtype([(one.name, *_tupled(one.kind)) for one in fields])
        rows = np.frombuffer(messages.content, kind)
        self.time: NDArray[np.float64] = messages.times / NS
        self.units: dict[str, str] = {one.name: one.unit for one in fields}
        self._arrays: dict[str, Array] = {one.name: rows[one.name] for one in fields}
        for flag in [name for name in self._arrays if name.split(".")[-1] == "present"]:
            self._mask(flag.removesuffix("present"), self._arrays[flag])

    def _mask(self, prefix: str, present: Array) -> None:
        """Replace the numbers below `prefix` by NaN where they are absent. Leave out a part of a
        message that never is present. present: a flag, or a bit for each of `_BITS`."""
        own = [name for name in self._arrays if name.startswith(prefix)]
        if prefix and present.dtype.kind == "b" and not present.any():
            for name in own:
                del self._arrays[name]
            return
        for name in own:
            values, field = self._arrays[name], name.removeprefix(prefix)
            there = present
            if present.dtype.kind != "b":
                bit = _BITS.index(field) if field in _BITS else None
                there = np.full(len(present), True) if bit is None else (present >> bit) & 1 > 0
            if values.dtype.kind == "f" and not there.all():
                self._arrays[name] = np.where(
                    there[:, None] if values.ndim > 1 else there, values, np.nan
                )

    def __getitem__(self, name: str) -> Array:
        found = self._arrays.get(name)
        if found is None:
            raise SignalUnknown(f"there is no signal `{name}`; {did_you_mean(name, self._arrays)}")
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def __contains__(self, name: object) -> bool:
        return name in self._arrays

    def columns(self) -> dict[str, Array]:
        """Return the signals as columns of single numbers whose names end with their unit, such as
        `estimate_position_x_m`, beginning with `time_s`."""
        columns: dict[str, Array] = {"time_s": self.time}
        for name, values in self._arrays.items():
            flat, unit = name.replace(".", "_"), _suffix(self.units[name])
            if values.ndim == 1:
                columns[flat + unit] = values
                continue
            width = values.shape[1]
            axes = {3: _AXES[0], 4: _AXES[1]}.get(width, tuple(map(str, range(width))))
            for index, axis in enumerate(axes):
                columns[f"{flat}_{axis}{unit}"] = values[:, index]
        return columns


def _tupled(kind: Any) -> tuple[Any, ...]:
    return kind if isinstance(kind, tuple) else (kind,)


def _suffix(unit: str) -> str:
    """Return the unit as the end of a column's name: `m/s^2` becomes `_m_s2`."""
    return "_" + unit.replace("/", "_").replace("^", "").replace(" ", "_") if unit else ""

"""A run as Python sees it: what happened, and its signals as arrays.

A run that was killed has no summary, and a recording that ends early; one that still flies is read
as far as it is written. Arrays have one row for each tick, at the control rate.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property
from html import escape
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np
from mcap.exceptions import McapError
from numpy.typing import NDArray

from kybflow.api.missions import Findings, validate
from kybflow.core.errors import FileError, KybflowError
from kybflow.core.files import read_all
from kybflow.core.signals import NS, Event
from kybflow.core.text import did_you_mean
from kybflow.dsl.reading.reader import PROVENANCE, RESOLVED
from kybflow.recording.messages import Recording, read_mission, read_recording
from kybflow.recording.run_folder import EVENTS, LOG, SUMMARY, RunFolderError, whole_lines
from kybflow.recording.signals import Signals, SignalUnknown

Vectors = NDArray[np.float64]


class LibraryMissing(KybflowError):
    """A library for data isn't installed; the message says how to install it."""


def imported(what: str, *names: str, extra: str = "analysis") -> Any:
    """Return the first of these modules that is installed. what: what needs it. extra: the one of
    kybflow that brings them. Raises LibraryMissing."""
    for name in names:
        with suppress(ImportError):
            return import_module(name)
    packages = " or ".join(name.partition(".")[0] for name in names)
    raise LibraryMissing(f"{what} needs {packages}: pip install 'kybflow[{extra}]'")


class RecordedVehicle(Signals):
    """The ticks of a vehicle: `vehicle["setpoint.velocity"]`, or by the names below what is asked
    for most. Each has a row for each time of `time`, which is in seconds since the start of the
    run. World frame, metres and seconds; quaternions (w, x, y, z), body to world.

    name: of the vehicle. `units`, `columns()`: of all its signals. `keys()` lists them.
    """

    def __init__(self, name: str, recording: Recording, events: tuple[Event, ...]) -> None:
        super().__init__(recording[f"/{name}/tick"])
        self.name = name
        self._recording, self._events = recording, events
        self._states: dict[str, Any] = recording.mission["vehicles"][name]["states"]

    @property
    def position(self) -> Vectors:
        """Where the vehicle believed to be, m, shape (n, 3)."""
        return self["estimate.position"]

    @property
    def velocity(self) -> Vectors:
        """As it was estimated, m/s, shape (n, 3)."""
        return self["estimate.velocity"]

    @property
    def attitude(self) -> Vectors:
        """As it was estimated, shape (n, 4)."""
        return self["estimate.attitude"]

    @property
    def setpoint(self) -> Vectors:
        """The position that the tracker followed, m, shape (n, 3)."""
        return self["setpoint.position"]

    @property
    def error(self) -> Vectors:
        """The distance of the vehicle from the setpoint that the tracker followed, m, shape (n,):
        of its true position in simulation, of its estimate on hardware. NaN in take-off and
        landing, where a setpoint may be below the ground, and without a setpoint. The summary's
        errors are those from the behavior's setpoint, and count in these states too."""
        where = self.get("truth.position", self.position)
        gap: Vectors = np.linalg.norm(self.setpoint - where, axis=1)
        aloft = [name for name, facts in self._states.items() if facts["aloft"]]
        return np.where(np.isin(self.state, aloft), gap, np.nan)

    @cached_property
    def state(self) -> NDArray[Any]:
        """The state, such as `hover`, in each tick, shape (n,), of objects."""
        names, starts = ["landed"], [-1.0]
        for event in self._events:
            if event.name == "behavior_started" and event.vehicle == self.name:
                names.append(str(event.fields["behavior"]))
                starts.append(event.time / NS)
        index = np.searchsorted(np.array(starts), self.time + 0.5 / NS, side="right") - 1
        states: NDArray[Any] = np.array(names, object)[index]
        return states

    @property
    def sensors(self) -> tuple[str, ...]:
        """The further recorded signals: `imu`, `pose`, `battery`, `estimator/NAME`..."""
        prefix, topics = f"/{self.name}/", self._recording.topics
        own = (
            t.removeprefix(prefix)
            for t, m in topics.items()
            if t.startswith(prefix) and m.definition
        )
        return tuple(sorted(topic for topic in own if topic != "tick"))

    def sensor(self, name: str) -> Signals:
        """Return the measurements of a sensor, or another of `sensors`, as they arrived. Raises
        SignalUnknown."""
        if name not in self.sensors:
            known = did_you_mean(name, self.sensors)
            raise SignalUnknown(f"`{self.name}` has no recorded `{name}`; {known}")
        return Signals(self._recording[f"/{self.name}/{name}"])

    def columns(self) -> dict[str, NDArray[Any]]:
        columns, names = super().columns(), np.full(len(self.time), self.name, object)
        time = columns.pop("time_s")
        return {"time_s": time, "vehicle": names, "state": self.state, **columns}


class Run:
    """A run in its folder. Use `Run.load(FOLDER)`, or what `kybflow.run` returns.

    folder: its folder. summary: the content of `summary.json`; empty if the run was killed. events:
    what happened, in order; `event.time` is in nanoseconds since the start of the run.
    """

    def __init__(self, folder: Path, mission: dict[str, Any]) -> None:
        self.folder = folder
        self._mission = mission
        self._vehicles: dict[str, RecordedVehicle] = {}
        self.summary: dict[str, Any] = {}
        if (folder / SUMMARY).exists():
            self.summary = dict(json.loads(read_all(folder / SUMMARY)))
        if not (folder / EVENTS).exists():
            raise RunFolderError(f"`{folder}` is not a readable run: it has no `{EVENTS}`")
        records = [json.loads(line) for line in whole_lines(folder / EVENTS)]
        self.events: tuple[Event, ...] = tuple(
            Event(round(r["t_s"] * NS), r["event"], r["vehicle"], r["fields"], r["at"])
            for r in records
        )

    @classmethod
    def load(cls, folder: str | Path) -> Run:
        """Read the run in `folder`. Raises RunFolderError."""
        path = Path(folder)
        with readable(path):
            return cls(path, read_mission(path / LOG))

    @property
    def outcome(self) -> str:
        """`succeeded`, `failed`, `interrupted`, `driver_failed`, or `killed` without a summary."""
        return str(self.summary.get("outcome", "killed"))

    @property
    def succeeded(self) -> bool:
        return self.outcome == "succeeded"

    @property
    def reason(self) -> str:
        """Why the run didn't succeed; empty if it did."""
        return self.summary.get("reason") or ""

    @property
    def expectations(self) -> list[dict[str, Any]]:
        """The verdicts of the mission's expectations, as in the summary."""
        return list(self.summary.get("expectations", ()))

    @cached_property
    def findings(self) -> Findings:
        """What validating the mission that was flown finds now."""
        return validate(self.folder / RESOLVED, target=self.provenance.get("target"))

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """The content of `provenance.json`; empty without it."""
        path = self.folder / PROVENANCE
        found: dict[str, Any] = json.loads(read_all(path)) if path.exists() else {}
        return found

    @property
    def vehicles(self) -> tuple[str, ...]:
        """The names of the vehicles."""
        return tuple(self._mission["vehicles"])

    def vehicle(self, name: str) -> RecordedVehicle:
        """Return the recorded signals of a vehicle; only its part of the recording is read. Raises
        SignalUnknown, and RunFolderError if the recording can't be read."""
        if name not in self.vehicles:
            known = did_you_mean(name, self.vehicles)
            raise SignalUnknown(f"`{self.folder.name}` has no vehicle `{name}`; {known}")
        [vehicle] = self._read([name])
        return vehicle

    def each(self) -> list[RecordedVehicle]:
        """Return the recorded signals of every vehicle; the recording is read once. Raises
        RunFolderError."""
        return self._read(self.vehicles)

    def _read(self, names: Sequence[str]) -> list[RecordedVehicle]:
        new = [name for name in names if name not in self._vehicles]
        if new:
            prefixes = tuple(f"/{name}/" for name in new)
            with readable(self.folder):
                log = read_recording(self.folder / LOG, lambda topic: topic.startswith(prefixes))
            without = [name for name in new if f"/{name}/tick" not in log.topics]
            if without:
                reason = f": {self.reason}" if self.reason else ""
                raise RunFolderError(
                    f"`{self.folder}` has no ticks of `{without[0]}`, because the run ended before "
                    f"it could take off{reason}"
                )
            self._vehicles |= {name: RecordedVehicle(name, log, self.events) for name in new}
        return [self._vehicles[name] for name in names]

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the ticks of all vehicles, one after the other, as columns of single numbers; a
        signal that a vehicle doesn't have is NaN. Names end with the unit."""
        each = [vehicle.columns() for vehicle in self.each()]
        names = dict.fromkeys(name for columns in each for name in columns)
        return {
            name: np.concatenate([c[name] if name in c else _nothing(c["time_s"]) for c in each])
            for name in names
        }

    def frame(self, library: Literal["pandas", "polars"] | None = None) -> Any:
        """Return `columns()` as a data frame of pandas or, if that isn't installed, of polars.
        Raises LibraryMissing."""
        names = ("pandas", "polars") if library is None else (library,)
        return imported("a data frame", *names).DataFrame(self.columns())

    def __repr__(self) -> str:
        seed = f", seed {self.summary['seed']}" if self.summary else ""
        return f"<Run {self.folder.name}: {self._mission['mission']}{seed}, {self.outcome}>"

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        facts: Mapping[str, object] = {
            "mission": self._mission["mission"],
            "outcome": f"{self.outcome}: {self.reason}" if self.reason else self.outcome,
            "seed": self.summary.get("seed", ""),
            "time": f"{self.summary['sim_time_s']:.1f} s" if self.summary else "",
            "vehicles": ", ".join(self.vehicles),
            "folder": self.folder,
        }
        rows = "".join(
            f"<tr><th>{escape(name)}</th><td>{escape(str(value))}</td></tr>"
            for name, value in facts.items()
            if value != ""
        )
        return f"<table>{rows}</table>"


@contextmanager
def readable(folder: Path) -> Iterator[None]:
    """Turn the errors of an unreadable folder into RunFolderError."""
    try:
        yield
    except (OSError, ValueError, LookupError, FileError, McapError) as error:
        why = str(error) or f"`{LOG}` is empty"
        raise RunFolderError(f"`{folder}` is not a readable run: {why}") from error
    except (TypeError, AttributeError, OverflowError) as error:
        raise RunFolderError(f"`{folder}` is not a readable run: a file is damaged") from error


def _nothing(like: NDArray[Any]) -> NDArray[Any]:
    return np.full(len(like), np.nan)

"""The run folder and its files, except for the recording.

Written before the run: `mission.resolved.yaml`, the files that it names, and `provenance.json`.
During the run: `events.jsonl`, one line per event, and a table per input. After the run:
`summary.json` and `report.html`. Only `provenance.json`, `summary.json` and the folder's name
depend on the wall clock; the other files depend on plan and seed alone.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
from codecs import BOM_UTF8
from collections.abc import Container, Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from kybflow.core.errors import KybflowError
from kybflow.core.files import CONTROL, File, write_whole
from kybflow.core.signals import Event, InputReading, Time
from kybflow.dsl.plan import EstimatorPlan, InputPlan, Plan, SensorPlan
from kybflow.dsl.reading.reader import PROVENANCE, RESOLVED
from kybflow.inputs.rows import InputRow, head, line
from kybflow.recording.growing_file import GrowingFile
from kybflow.recording.layout import event_record

if TYPE_CHECKING:
    from datetime import datetime

SUMMARY, EVENTS, LOG, REPORT = "summary.json", "events.jsonl", "log.mcap", "report.html"
FRAMES = "frames"
"""The folder of the camera pictures."""
INPUTS = "inputs"
"""The folder of the input tables (`kybflow.inputs.script`)."""
FILES = frozenset({CONTROL, SUMMARY, EVENTS, LOG, REPORT, RESOLVED, PROVENANCE, FRAMES, INPUTS})
FLOWN_FROM = "files"
"""The key in `provenance.json` that lists the copies of the mission's files."""
_VERSION = re.compile(r"^Version: *(.*)$", re.MULTILINE)
_PACKAGES = ("kybflow", "mujoco", "numpy", "foxglove-sdk", "transitions", "PyYAML", "jsonschema")


class RunFolderError(KybflowError):
    """A folder can't be used for a run; the message says what to do."""


class RunUnwritten(RunFolderError):
    """A file of a run can't be written, for example on a full or read-only disk."""


class RunFolder:
    """The folder of a run. failed: why a file can't be written, None while all can."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._events = GrowingFile(path / EVENTS, "list of events")
        self._unwritten: str | None = None
        self._inputs: dict[str, tuple[GrowingFile, tuple[str, ...]]] = {}

    @property
    def failed(self) -> str | None:
        files = (self._events, *(file for file, _ in self._inputs.values()))
        return next((file.failed for file in files if file.failed), self._unwritten)

    @property
    def log(self) -> Path:
        """The path of the recording."""
        return self.path / LOG

    def event(self, event: Event) -> None:
        """Append an event. Never raises; an error is stored in `failed`, and later events are
        dropped."""
        line = json.dumps(event_record(event), ensure_ascii=False) + "\n"
        self._events.write(line.encode())

    def input(self, name: str, now: Time, reading: InputReading | None, why: str) -> None:
        """Append to an input's table a reading, or the reason `why` there is none. Never raises."""
        row = InputRow(now, {}, lost=why) if reading is None else InputRow(now, *reading[1:3])
        if name in self._inputs:
            file, axes = self._inputs[name]
            file.write(line(row, axes).encode())

    def check(self) -> None:
        """Check that the growing files still hold what was written."""
        self._events.check()
        for file, _ in self._inputs.values():
            file.check()

    def describe(self, plan: Plan, request: Mapping[str, Any], started: datetime) -> None:
        """Write the resolved mission, the files that it names, and `provenance.json`; open the
        input tables. Raises RunUnwritten."""
        files = copies(plan.files, FILES)
        write_file(self.path / RESOLVED, plan.resolved)
        write_file(self.path / PROVENANCE, _json(provenance(plan, request, started, files)))
        for name, file in files.items():
            write_file(self.path / name, contents(file))
        for own in plan.inputs:
            self._open_table(own)

    def _open_table(self, plan: InputPlan) -> None:
        path = self.path / INPUTS / f"{plan.name}.csv"
        axes: tuple[str, ...] = plan.part.cls.axes(plan.part.params)
        try:
            path.parent.mkdir(exist_ok=True)
            file = GrowingFile(path, f"table of `{plan.name}`")
        except OSError as error:
            raise RunUnwritten(f"`{path}` can't be written: {error.strerror}") from error
        self._inputs[plan.name] = file, axes
        file.write(head(axes).encode())

    def add(self, name: str, data: bytes) -> Path:
        """Write another file of the run and return its path. name: its path within the folder.
        Raises RunUnwritten and leaves no incomplete file."""
        path = self.path / name
        write_file(path, data)
        return path

    def finish(self, summary: dict[str, Any]) -> bool:
        """Close the folder and write the summary; return whether the summary could be written."""
        self.close()
        try:
            write_file(self.path / SUMMARY, _json(summary))
        except RunUnwritten as error:
            self._unwritten = str(error)
            return False
        return True

    def close(self) -> None:
        """Close the growing files; may be called again."""
        self._events.close()
        for file, _ in self._inputs.values():
            file.close()


def create_run_folder(plan: Plan, out: Path | None, started: datetime) -> RunFolder:
    """Create the folder `out`, or `runs/<mission>-<time>` with a number appended if that exists.

    `out` must be new or empty. Raises RunFolderError for a folder with files, RunUnwritten if the
    folder can't be created.
    """
    path = (
        out if out is not None else _free(Path("runs"), f"{plan.mission}-{started:%Y%m%d-%H%M%S}")
    )
    try:
        path.mkdir(parents=True, exist_ok=True)
        _check_empty(path)
        return RunFolder(path)
    except OSError as error:
        raise RunUnwritten(f"`{path}` can't be written: {error.strerror or error}") from error


def _free(parent: Path, name: str) -> Path:
    path, number = parent / name, 2
    while path.exists():
        path, number = parent / f"{name}-{number}", number + 1
    return path


def _check_empty(path: Path) -> None:
    """Raise RunFolderError for a folder with files, because a run never replaces files."""
    found = sorted(entry.name for entry in path.iterdir())
    ours = FILES | _copied(path)
    foreign = [name for name in found if name not in ours or EVENTS not in found]
    if foreign:
        more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        raise RunFolderError(
            f"`{path}` holds files of no run (`{foreign[0]}`{more}); name another folder"
        )
    if found:
        raise RunFolderError(f"`{path}` holds an earlier run; name another folder, or remove it")


def _copied(path: Path) -> set[str]:
    """Return the entries of an earlier run's folder that are copies of its mission's files."""
    try:
        names = json.loads((path / PROVENANCE).read_text(encoding="utf-8"))[FLOWN_FROM]
        return {PurePath(name).parts[0] for name in names}
    except (OSError, ValueError, LookupError, TypeError):
        return set()


def copies(files: Iterable[File], taken: Container[str]) -> dict[str, File]:
    """Return the mission's files by their path in the run folder.

    The paths are those in the resolved mission, so that the copy can be flown from there. A file is
    left out if its path is `taken` by the run or needed by another file: the compiler reports a
    missing file but would not notice a wrong one.
    """
    placed: dict[str, dict[str, File]] = {}
    for file in files:
        placed.setdefault(os.path.normpath(file.name), {})[file.sha256] = file
    folders = {str(above) for name in placed for above in PurePath(name).parents}
    return {
        name: file
        for name, (file, *others) in ((name, [*of.values()]) for name, of in placed.items())
        if not others and name not in folders and PurePath(name).parts[0] not in taken
    }


def contents(file: File) -> bytes:
    """Return the bytes of a file as they were read, including a byte order mark if there was
    one."""
    data = file.data
    same = hashlib.sha256(data).hexdigest() == file.sha256
    return data if same else BOM_UTF8 + data


def provenance(
    plan: Plan, request: Mapping[str, Any], started: datetime, files: Iterable[str]
) -> dict[str, Any]:
    """Return the content of `provenance.json`: the request, the sources with their SHA-256, the
    paths of the copied `files`, the versions and the machine."""
    # like `platform.platform()`, which would run `uname -p`
    kernel, libc = f"{platform.system()}-{platform.release()}", "".join(platform.libc_ver())
    return {
        "kybflow": 1,
        "mission": plan.mission,
        "target": plan.target,
        **request,
        "started": started.isoformat(timespec="seconds"),
        "sources": [{"path": source.path, "sha256": source.sha256} for source in plan.sources],
        FLOWN_FROM: [*files],
        "versions": {"python": platform.python_version(), **_versions(_packages(plan))},
        "machine": {
            "system": f"{kernel}-{platform.machine()}-{libc or 'unknown'}",
            "processor": platform.machine(),
            "cores": os.cpu_count(),
        },
    }


def _packages(plan: Plan) -> Iterator[str]:
    """Yield the packages that every run uses, then those of its sensors, estimators and inputs."""
    yield from _PACKAGES
    for vehicle in plan.vehicles:
        parts: list[SensorPlan | EstimatorPlan] = [*vehicle.sensors, *vehicle.estimators]
        for plan_part in parts:
            yield from plan_part.part.cls.packages
    for own in plan.inputs:
        yield from own.part.cls.packages


def _versions(packages: Iterable[str]) -> dict[str, str]:
    """Return the versions of the installed packages. Only the head of their metadata is searched,
    because `importlib.metadata.version` parses all of it as an e-mail and is slow."""
    found = {}
    for package in dict.fromkeys(packages):
        try:
            files = distribution(package)
        except PackageNotFoundError:
            continue
        metadata = files.read_text("METADATA") or files.read_text("PKG-INFO") or ""
        if version := _VERSION.search(metadata):
            found[package] = version[1]
    return found


def _json(value: dict[str, Any]) -> str:
    return json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_file(path: Path, what: str | bytes) -> None:
    """Write a file of a run completely or not at all. Raises RunUnwritten."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, what if isinstance(what, bytes) else what.encode())
    except OSError as error:
        raise RunUnwritten(f"`{path}` can't be written: {error.strerror or error}") from error

"""The folder that a run leaves, and the files beside the recording.

`events.jsonl` is written as the run goes, a line an event; `mission.resolved.yaml`, the files that
it names and `provenance.json` before it, `summary.json` and `report.html` after it. Points in
wall-clock time stand in `provenance.json` and in the folder's name only, how long it took in
`summary.json`; the other files depend on plan and seed alone.
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
from kybflow.dsl.reading.folders import PROVENANCE, RESOLVED
from kybflow.inputs.rows import InputRow, head, line
from kybflow.recording.growing_file import GrowingFile
from kybflow.recording.layout import event_record

if TYPE_CHECKING:
    from datetime import datetime

SUMMARY, EVENTS, LOG, REPORT = "summary.json", "events.jsonl", "log.mcap", "report.html"
FRAMES = "frames"
"""The folder of what cameras saw."""
INPUTS = "inputs"
"""The folder of what inputs said, a table of each (`kybflow.inputs.script`)."""
FILES = frozenset({CONTROL, SUMMARY, EVENTS, LOG, REPORT, RESOLVED, PROVENANCE, FRAMES, INPUTS})
FLOWN_FROM = "files"
"""The key of `provenance.json` for the mission's files that are in the run folder."""
_VERSION = re.compile(r"^Version: *(.*)$", re.MULTILINE)
_PACKAGES = ("kybflow", "mujoco", "numpy", "foxglove-sdk", "transitions", "PyYAML", "jsonschema")


class RunFolderError(KybflowError):
    """A folder can't be used for a run; the message says what to do."""


class RunUnwritten(RunFolderError):
    """A file of a run can't be written: the disk is full, or nobody may write there."""


class RunFolder:
    """The folder of one run. `failed` is None, or why something of it could not be written."""

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
        """Where the recording goes."""
        return self.path / LOG

    def event(self, event: Event) -> None:
        """Append one event. Raises nothing: an error is kept in `failed` and ends the file."""
        line = json.dumps(event_record(event), ensure_ascii=False) + "\n"
        self._events.write(line.encode())

    def input(self, name: str, now: Time, reading: InputReading | None, why: str) -> None:
        """Append what an input says, or why it says nothing, to its table. Raises nothing."""
        row = InputRow(now, {}, lost=why) if reading is None else InputRow(now, *reading[1:3])
        if name in self._inputs:
            file, axes = self._inputs[name]
            file.write(line(row, axes).encode())

    def look(self) -> None:
        """Look whether what grows is still in its place."""
        self._events.look()
        for file, _ in self._inputs.values():
            file.look()

    def describe(self, plan: Plan, request: Mapping[str, Any], started: datetime) -> None:
        """Write the resolved mission, the files that it names, and `provenance.json`. Raises
        RunUnwritten."""
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
        """Write one more file, `name` being its path within the folder; its whole path. Raises
        RunUnwritten, and leaves no half of the file then."""
        path = self.path / name
        write_file(path, data)
        return path

    def finish(self, summary: dict[str, Any]) -> bool:
        """Close the folder and write the summary. Raises nothing; returns False when the summary
        can't be written, and leaves none then."""
        self.close()
        try:
            write_file(self.path / SUMMARY, _json(summary))
        except RunUnwritten as error:
            self._unwritten = str(error)
            return False
        return True

    def close(self) -> None:
        """Close what grows; may be called again."""
        self._events.close()
        for file, _ in self._inputs.values():
            file.close()


def create_run_folder(plan: Plan, out: Path | None, started: datetime) -> RunFolder:
    """`out`, or `runs/<mission>-<time>` in the present folder, with a number behind it if taken.

    `out` may be new or empty. Raises RunFolderError for any other folder, an earlier run's too, and
    RunUnwritten where none can be made.
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
    """Raise RunFolderError for a folder with anything in it: nothing is ever replaced."""
    found = sorted(entry.name for entry in path.iterdir())
    ours = FILES | _copied(path)
    foreign = [name for name in found if name not in ours or EVENTS not in found]
    if foreign:
        more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        raise RunFolderError(
            f"`{path}` holds what no run has written (`{foreign[0]}`{more}); name another folder"
        )
    if found:
        raise RunFolderError(f"`{path}` holds an earlier run; name another folder, or remove it")


def _copied(path: Path) -> set[str]:
    """The entries of an earlier run's folder that are files of its mission."""
    try:
        names = json.loads((path / PROVENANCE).read_text(encoding="utf-8"))[FLOWN_FROM]
        return {PurePath(name).parts[0] for name in names}
    except (OSError, ValueError, LookupError, TypeError):
        return set()


def copies(files: Iterable[File], taken: Container[str]) -> dict[str, File]:
    """The files that a mission names, by their place in the run folder, which is the name that the
    resolved mission gives them, so that it flies from there. A file is left out where its place is
    not its own, because it is `taken` by the run itself, or another file of the mission names a
    different file by it: a missing file is refused, a wrong one would fly."""
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
    """The bytes of a file as they were read: its text, after a byte order mark if it had one."""
    data = file.data
    same = hashlib.sha256(data).hexdigest() == file.sha256
    return data if same else BOM_UTF8 + data


def provenance(
    plan: Plan, request: Mapping[str, Any], started: datetime, files: Iterable[str]
) -> dict[str, Any]:
    """The content of `provenance.json`: what the run was made of and the `request` for it, sources
    with their SHA-256, the copied `files`, versions, machine."""
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
            "system": _system(),
            "processor": platform.machine(),
            "cores": os.cpu_count(),
        },
    }


def _packages(plan: Plan) -> Iterator[str]:
    """The packages that every run uses, then those that its sensors and estimators need."""
    yield from _PACKAGES
    for vehicle in plan.vehicles:
        parts: list[SensorPlan | EstimatorPlan] = [*vehicle.sensors, *vehicle.estimators]
        for plan_part in parts:
            yield from plan_part.part.cls.packages
    for own in plan.inputs:
        yield from own.part.cls.packages


def _versions(packages: Iterable[str]) -> dict[str, str]:
    """The versions of the packages that are installed, read from the head of what they say of
    themselves; `importlib.metadata.version` parses the whole of it as an e-mail."""
    found = {}
    for package in dict.fromkeys(packages):
        try:
            files = distribution(package)
        except PackageNotFoundError:
            continue
        said = files.read_text("METADATA") or files.read_text("PKG-INFO") or ""
        if version := _VERSION.search(said):
            found[package] = version[1]
    return found


def _system() -> str:
    """Kernel, processor and C library, as `platform.platform` has them, which starts `uname -p`."""
    libc = "".join(platform.libc_ver()) or "unknown"
    return f"{platform.system()}-{platform.release()}-{platform.machine()}-{libc}"


def _json(value: dict[str, Any]) -> str:
    return json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_file(path: Path, what: str | bytes) -> None:
    """Write a file of a run, or leave none. Raises RunUnwritten."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, what if isinstance(what, bytes) else what.encode())
    except OSError as error:
        raise RunUnwritten(f"`{path}` can't be written: {error.strerror or error}") from error

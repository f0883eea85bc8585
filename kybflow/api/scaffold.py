"""`kybflow new`: copies a mission that an installed package provides."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from kybflow.api.library import OWN, Shipped, libraries, missions
from kybflow.core.errors import KybflowError
from kybflow.core.text import did_you_mean
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.diagnostics import Span
from kybflow.dsl.language.published import schema_text
from kybflow.dsl.reading.nodes import Mapping, Scalar, entries_of
from kybflow.parts.catalog import load_catalog

SCHEMA = "mission.schema.json"
"""The JSON schema for editors, in the same folder as the missions."""
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,59}\Z", re.ASCII)
_LINE = f"# yaml-language-server: $schema={SCHEMA}\n"


class _Change(NamedTuple):
    span: Span
    text: str


def scaffold(name: str, origin: str, folder: Path) -> tuple[Path, ...]:
    """Copy the shipped mission `origin` into `folder` under the name `name`, with the files that it
    uses, and the JSON schema for editors if `folder` has none. Return the written files: attached
    files, mission, schema. Never overwrites a file. Raises KybflowError."""
    if not _NAME.match(name):
        raise KybflowError(f"`{name}` can't be the name of a mission: letters, digits and `_`")
    path, schema, known = folder / f"{name}.yaml", folder / SCHEMA, {m.name: m for m in missions()}
    one = known.get(origin.removeprefix(f"{OWN}/").removesuffix(".yaml"))
    if one is None or one.root is None:
        hint = did_you_mean(origin, known)
        raise KybflowError(f"no package ships a mission `{origin}`; {hint}")
    sources = {folder / file: one.path.parent / file for file in _attached(one)}
    wanted = {target: source.read_text(encoding="utf-8") for target, source in sources.items()}
    for file, text in list(wanted.items()):
        if file.is_file() and file.read_text(encoding="utf-8", errors="replace") == text:
            del wanted[file]
    wanted[path] = _rewritten(one, name)
    if not schema.exists():
        wanted[schema] = schema_text(load_catalog())
    taken = next((file for file in wanted if file.exists()), None)
    if taken is not None:
        raise KybflowError(f"`{taken}` is there already; nothing was written")
    for file, text in wanted.items():
        _write(file, text)
    return tuple(wanted)


def _attached(one: Shipped) -> Iterator[str]:
    """Yield the paths of the files that the mission uses, relative to its folder."""
    plan = compile_mission(one.path, catalog=load_catalog()).plan
    for source in plan.sources if plan is not None else ():
        path = Path(source.path)
        if path.suffix not in (".yaml", ".yml"):
            yield os.path.relpath(path, one.path.parent)


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as stream:
            stream.write(text)
    except FileExistsError:
        raise KybflowError(f"`{path}` is there already; nothing was written") from None
    except OSError as error:
        raise KybflowError(f"`{path}` can't be written: {error.strerror}") from None


def _rewritten(one: Shipped, name: str) -> str:
    """Return the mission's text with its new name, with libraries imported by package, and with the
    line that names the schema."""
    lines = one.source.text.splitlines(keepends=True)
    for change in sorted(_changes(one, name), key=lambda c: c.span.column, reverse=True):
        span, at = change.span, change.span.line - 1
        line = lines[at]
        lines[at] = line[: span.column - 1] + change.text + line[span.end_column - 1 :]
    kept = [line for line in lines if not line.startswith("# yaml-language-server:")]
    return _LINE + "".join(kept)


def _changes(one: Shipped, name: str) -> Iterator[_Change]:
    root = one.root
    assert isinstance(root, Mapping)
    mission = root.get("mission")
    if isinstance(mission, Scalar):
        yield _Change(mission.span, name)
    known = {os.path.realpath(library.path): library.name for library in libraries()}
    for entry in entries_of(root.get("import")).values():
        written = entry.value
        file = written.get("from") if isinstance(written, Mapping) else written
        if isinstance(file, Scalar):
            target = os.path.realpath(one.path.parent / file.text)
            if target in known:
                yield _Change(file.span, known[target])

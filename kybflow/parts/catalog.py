"""The catalog finds parts by their files.

`kybflow/runtime/behaviors/circle.py` is the behavior `circle`; its class is `Circle`, or
`CircleBehavior` if that name is taken. Another package offers its parts through the entry-point
group `kybflow.parts`: each entry names a package with the same folders (`behaviors/`,
`estimators/`, ...). Listing names imports no part; `Catalog.get` does.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import inspect
import os
import pkgutil
import sys
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import entry_points
from pathlib import Path
from traceback import extract_tb
from typing import Any

from kybflow.core.errors import PartError, described
from kybflow.core.params import Field, fields_of
from kybflow.core.sources import docstring_of, is_compiled
from kybflow.parts import (
    Action,
    Behavior,
    Coordinator,
    Driver,
    Estimator,
    Fault,
    Input,
    Part,
    Processor,
    Sensor,
    Supervisor,
    Tracker,
)

BASES: dict[str, type[Part[Any]]] = {
    base.kind: base
    for base in (
        Behavior, Estimator, Processor, Tracker, Supervisor, Coordinator, Driver, Sensor, Input,
        Fault, Action,
    )
}  # fmt: skip
_HOMES = {"drivers": "kybflow", "sensors": "kybflow", "inputs": "kybflow"}
GROUP = "kybflow.parts"


@dataclass(frozen=True)
class PartSpec:
    """A part: its class, the class and the fields of its parameters, and the docstring of its
    module."""

    kind: str
    name: str
    cls: type[Any]
    params: type[Any]
    fields: tuple[Field, ...]
    doc: str

    @property
    def summary(self) -> str:
        """The first line of the part's docstring."""
        return self.doc.strip().splitlines()[0]


class Catalog:
    """The available parts, by kind and name. files: those that were named, with the SHA-256 of
    what was imported."""

    files: tuple[tuple[Path, str], ...] = ()

    def __init__(
        self, modules: dict[str, dict[str, str]], files: tuple[tuple[Path, str], ...] = ()
    ) -> None:
        self.files = files
        self._modules = modules
        self._names = {kind: tuple(sorted(names)) for kind, names in modules.items()}
        self._specs: dict[tuple[str, str], PartSpec] = {}
        self._always: dict[str, tuple[PartSpec, ...]] = {}

    def kinds(self) -> tuple[str, ...]:
        """Return every kind of part, in plural: `behaviors`, `estimators`, ..."""
        return tuple(BASES)

    def names(self, kind: str) -> tuple[str, ...]:
        """Return the sorted names of the parts of a kind."""
        return self._names.get(kind, ())

    def get(self, kind: str, name: str) -> PartSpec:
        """Import a part's module and return its specification. Raises KeyError if the name is
        unknown, PartError if the declaration is invalid."""
        key = (kind, name)
        if key not in self._specs:
            self._specs[key] = _load(kind, name, self._modules[kind][name])
        return self._specs[key]

    def always(self, kind: str) -> tuple[PartSpec, ...]:
        """Return the parts of a kind that every vehicle has, even if the mission doesn't name
        them."""
        if kind not in self._always:
            found = (self.get(kind, name) for name in self.names(kind))
            self._always[kind] = tuple(s for s in found if getattr(s.cls, "always", False))
        return self._always[kind]


def own_catalog() -> Catalog:
    """Return the catalog of kybflow's own parts."""
    return Catalog(_own_modules())


def _own_modules() -> dict[str, dict[str, str]]:
    modules: dict[str, dict[str, str]] = {kind: {} for kind in BASES}
    for kind in BASES:
        _scan(modules[kind], kind, _HOMES.get(kind, "kybflow.runtime"))
    return modules


def load_catalog(*files: Path) -> Catalog:
    """Return the catalog of all installed parts, and of the parts in `files`, whose code is run.
    Raises PartError for a file that can't be imported or defines no part, if a name is offered
    twice, or if it is reserved by the language."""
    return _catalog(tuple((file, _digest(file)) for file in files))


@functools.cache
def _catalog(files: tuple[tuple[Path, str], ...]) -> Catalog:
    modules = _own_modules()
    for entry in entry_points(group=GROUP):
        for kind in BASES:
            _scan(modules[kind], kind, entry.value)
    for file, digest in files:
        kind, module = _imported(file, digest)
        _offer(modules[kind], kind, file.stem, module)
    return Catalog(modules, files)


def _digest(file: Path) -> str:
    try:
        return sha256(file.read_bytes()).hexdigest()
    except OSError as error:
        raise PartError(f"`{file}` can't be read: {error.strerror}") from None


def _imported(file: Path, digest: str) -> tuple[str, str]:
    """Import a file that defines a part. Return the part's kind and the name of its module, which
    changes with its content, so that an edited file is imported anew."""
    name = f"kybflow_part_{file.stem}_{digest[:12]}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise PartError(f"`{file}` is not a Python file")
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # somebody's own code may raise anything
        frames, own = extract_tb(error.__traceback__), os.path.abspath(file)
        lines = [at.lineno for at in frames if at.filename == own]
        at = getattr(error, "lineno", None) or (lines[-1] if lines else None)
        place = f"{file}:{at}" if at else str(file)
        raise PartError(f"{place} can't be imported: {described(error)}") from error
    classes = [c for c in vars(module).values() if inspect.isclass(c) and c.__module__ == name]
    kinds = [kind for kind, base in BASES.items() if any(issubclass(c, base) for c in classes)]
    if len(kinds) != 1:
        raise PartError(
            f"`{file}` should define one part: a class that inherits from `Tracker[...]`, "
            "`Behavior[...]` or another base class of `kybflow.parts`"
        )
    return kinds[0], name


def _scan(found: dict[str, str], kind: str, home: str) -> None:
    package = f"{home}.{kind}"
    try:
        spec = importlib.util.find_spec(package)
    except Exception as error:  # a lab's own package may raise anything while it is imported
        raise PartError(f"the package of {package} can't be imported: {error!r}") from error
    for info in pkgutil.iter_modules(spec.submodule_search_locations if spec else []):
        if info.name.startswith("_") or info.name in BASES[kind].helpers:
            continue
        _offer(found, kind, info.name, f"{package}.{info.name}")


def _offer(found: dict[str, str], kind: str, name: str, module: str) -> None:
    """Add the part of a module to those of its kind."""
    if name in BASES[kind].reserved:
        raise PartError(f"{module}: the language itself has the {kind[:-1]} `{name}`")
    if name in found:
        raise PartError(f"two packages offer `{name}`: {found[name]} and {module}")
    found[name] = module


def _load(kind: str, name: str, module_name: str) -> PartSpec:
    try:
        module = importlib.import_module(module_name)
    except Exception as error:  # a lab's own module may raise anything while it is imported
        raise PartError(f"{module_name} can't be imported: {error!r}") from error
    base = BASES[kind]
    expected = "".join(word.capitalize() for word in name.split("_"))
    wanted = (expected.lower(), f"{expected}{base.__name__}".lower())
    classes = [
        c
        for c in vars(module).values()
        if inspect.isclass(c) and issubclass(c, base) and c.__name__.lower() in wanted
    ]
    if not classes:
        shown = f"{base.__name__}[...]"
        raise PartError(
            f"{module_name} should define the class `{expected}({shown})` or "
            f"`{expected}{base.__name__}({shown})`"
        )
    cls = classes[0]
    doc = docstring_of(module_name)
    if not doc:
        raise PartError(f"{module_name} has no docstring")
    _judge_bases(cls)
    params = _params_of(cls)
    return PartSpec(kind, name, cls, params, fields_of(params), doc)


def _judge_bases(cls: type[Any]) -> None:
    """Raise PartError if a Python class inherits from a compiled class: Python can't construct
    it."""
    compiled = [base.__name__ for base in cls.__mro__ if is_compiled(base)]
    if compiled and not is_compiled(cls):
        raise PartError(
            f"{cls.__module__}.{cls.__name__} inherits from `{compiled[0]}`, which is compiled; "
            "inherit from classes of `kybflow.parts`, or install kybflow without mypyc"
        )


def _params_of(cls: type[Any]) -> Any:
    for base in getattr(cls, "__orig_bases__", ()):
        for argument in getattr(base, "__args__", ()):
            if inspect.isclass(argument):
                return argument
    raise PartError(
        f"{cls.__module__}.{cls.__name__} should name its parameters: "
        f"`class {cls.__name__}(Base[MyParams])`"
    )

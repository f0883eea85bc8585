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
import pkgutil
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Any

from kybflow.core.errors import PartError
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
    """The available parts, by kind and name."""

    def __init__(self, modules: dict[str, dict[str, str]]) -> None:
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


@functools.cache
def load_catalog() -> Catalog:
    """Return the catalog of all installed parts. Raises PartError if two packages offer the same
    part, or if the name of a part is reserved by the language."""
    modules = _own_modules()
    for entry in entry_points(group=GROUP):
        for kind in BASES:
            _scan(modules[kind], kind, entry.value)
    return Catalog(modules)


def _scan(found: dict[str, str], kind: str, home: str) -> None:
    package = f"{home}.{kind}"
    try:
        spec = importlib.util.find_spec(package)
    except Exception as error:  # a lab's own package may raise anything while it is imported
        raise PartError(f"the package of {package} can't be imported: {error!r}") from error
    for info in pkgutil.iter_modules(spec.submodule_search_locations if spec else []):
        if info.name.startswith("_") or info.name in BASES[kind].helpers:
            continue
        module = f"{package}.{info.name}"
        if info.name in BASES[kind].reserved:
            raise PartError(f"{module}: the language itself has the {kind[:-1]} `{info.name}`")
        if info.name in found:
            raise PartError(f"two packages offer `{info.name}`: {found[info.name]} and {module}")
        found[info.name] = module


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

"""What a file exports: its airframes, vehicles, stacks, worlds and flows, each whole after `like`
and with the parts of a stack in the place of `- stack: NAME`; its chains as they are written."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, Severity
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    entries_of,
    is_null,
)
from kybflow.dsl.resolving.imports import LibraryPath, installed, read_library
from kybflow.dsl.resolving.like import merge
from kybflow.dsl.resolving.parameters import ParameterTable
from kybflow.dsl.schema.building import LISTS

CODES = {
    "KYB157": "A stack that has nothing for the list in which it stands.",
}
_CHAIN = 20
EMPTY = Mapping({}, Span("", 1, 1, 1, 1))
_STANDARD = "kybflow/airframes"
SECTIONS = ("airframes", "vehicles", "chains", "stacks", "worlds", "flows")
"""What a library exports."""
_REMOVED = {"vehicles": "behaviors", "flows": "phases"}


class Exports:
    """The entries that one file exports. Each is resolved when it is first needed."""

    def __init__(
        self,
        root: Mapping,
        imports: dict[str, Exports | None],
        base: Mapping,
        parameters: ParameterTable,
    ) -> None:
        self._root = root
        self._imports = imports
        self._base = base
        self.parameters = parameters
        self._done: dict[tuple[str, str], Mapping | None] = {}
        self._qualified: dict[tuple[str, str], Mapping] = {}
        self._written: dict[str, dict[str, MappingEntry]] = {}
        self._open: list[tuple[str, str]] = []

    def own(self, section: str) -> list[str]:
        """The names that the file itself has in `section`."""
        return list(self.written(section))

    def names(self, section: str) -> list[str]:
        """The names that may be used in the file, those of its imports qualified."""
        imported = ((i, o.own(section)) for i, o in self._imports.items() if o is not None)
        return self.own(section) + [f"{i}.{n}" for i, names in imported for n in names]

    def get(self, section: str, name: str) -> Diagnosed[Mapping | None]:
        """The whole entry; None when it has errors or doesn't exist."""
        key = (section, name)
        if key not in self._done:
            self._open.append(key)
            self._done[key] = yield from self._whole(section, name)
            self._open.pop()
        return self._done[key]

    def _whole(self, section: str, name: str) -> Diagnosed[Mapping | None]:
        node = self._root.get(section)
        own = node.get(name) if isinstance(node, Mapping) else None
        if not isinstance(own, Mapping):
            own = EMPTY
        like = own.get("like")
        base: Mapping | None = self._base if section == "vehicles" else EMPTY
        if isinstance(like, Scalar):
            base = yield from self.named(section, like)
        if base is None:
            return None
        plain = Mapping({k: e for k, e in own.entries.items() if k != "like"}, own.span)
        if section in ("vehicles", "stacks"):
            plain = yield from self._with_stacks(plain)
        used = (like.span,) if section == "flows" and isinstance(like, Scalar) else ()
        whole = merge(base, plain, used)
        removed = _REMOVED.get(section)
        if removed is not None:
            yield from _not_there(base.get(removed), plain.get(removed), removed)
        airframe = plain.entries.get("airframe")
        if section == "vehicles" and airframe and whole.get("airframe") is not None:
            body = yield from self.started("airframes", airframe.value, whole.get("airframe"))
            if body is None:
                return None
            whole.entries["airframe"] = MappingEntry(airframe.key, body)
        return whole

    def started(self, section: str, written: Node, plain: Node | None) -> Diagnosed[Node | None]:
        """An entry of `section` in its place: the one that is named, or started from with `like`;
        `plain` where it is neither. None when it has errors."""
        if isinstance(written, Scalar):
            return (yield from self.named(section, written))
        like = written.get("like") if isinstance(written, Mapping) else None
        if not isinstance(written, Mapping) or not isinstance(like, Scalar):
            return plain
        base = yield from self.named(section, like)
        own = {key: entry for key, entry in written.entries.items() if key != "like"}
        return None if base is None else merge(base, Mapping(own, written.span))

    def named(self, section: str, name: Scalar) -> Diagnosed[Mapping | None]:
        """The entry that `name` (`x`, or `import.x`) means here."""
        key = (section, name.text)
        if key in self._open or len(self._open) > _CHAIN:
            verb = "has" if section == "stacks" else "is like"
            chain = f" {verb} ".join(f"`{n}`" for _, n in (*self._open, key))
            yield Diagnostic("KYB125", f"{chain[:200]}: this never ends", name.span)
            return None
        library, _, inner = name.text.rpartition(".")
        if library in self._imports:
            exports = self._imports[library]
            if exports is None:
                return None
            if inner in exports.written(section):
                return (yield from self._imported(section, library, inner, exports))
        elif not library and inner in self.written(section):
            return (yield from self.get(section, inner))
        yield self._unknown(section, name, library)
        return None

    def _imported(
        self, section: str, library: str, name: str, exports: Exports
    ) -> Diagnosed[Mapping | None]:
        """An entry of an import; the chains that a vehicle names are called as they are here."""
        whole = yield from exports.get(section, name)
        if whole is None or section != "vehicles":
            return whole
        key = (library, name)
        if key not in self._qualified:
            self._qualified[key] = _qualified(whole, library)
        return self._qualified[key]

    def _with_stacks(self, body: Mapping) -> Diagnosed[Mapping]:
        """A vehicle, or a stack, with every stack in its lists replaced by its parts. One without
        any stays the same object."""
        entries: dict[str, MappingEntry] = {}
        for key in LISTS:
            entry = body.entries.get(key)
            node = None if entry is None else entry.value
            if entry is not None and isinstance(node, Sequence) and any(map(stack_of, node.items)):
                items = yield from self._parts(key, node)
                entries[key] = entry._replace(value=Sequence(tuple(items), node.span))
        return Mapping({**body.entries, **entries}, body.span) if entries else body

    def _parts(self, key: str, written: Sequence) -> Diagnosed[list[Node]]:
        """The parts of a list in which stacks stand."""
        parts: list[Node] = []
        for item in written.items:
            name = stack_of(item)
            if name is None:
                parts.append(item)
                continue
            stack = yield from self.named("stacks", name)
            own = None if stack is None else stack.get(key)
            if isinstance(own, Sequence):
                parts += own.items
            elif stack is not None:
                others = " and ".join(other for other in LISTS if stack.get(other) is not None)
                message = f"the stack `{name.text}` has no {key}"
                hint = f"it has {others or 'nothing'}"
                yield Diagnostic("KYB157", message, name.span, help=hint)
        return parts

    def chain(self, name: Scalar) -> Diagnosed[tuple[Exports, str] | None]:
        """(the file, the name in it) of the chain that `chain.NAME` or `chain.IMPORT.NAME` means
        here; None, and a finding, where there is none."""
        *libraries, inner = name.text.split(".")[1:]
        exports: Exports = self
        for library in libraries:
            found = exports._imports.get(library)
            if library not in exports._imports:
                rest = name._replace(text=name.text.removeprefix("chain."))
                yield self._unknown("chains", rest, library)
            if found is None:
                return None
            exports = found
        if inner in exports.own("chains"):
            return exports, inner
        known = [f"chain.{own}" for own in self.names("chains")]
        hint = did_you_mean(name.text, known) or "no chain is at hand"
        message = f"no chain is called `{name.text.removeprefix('chain.')}`"
        yield Diagnostic("KYB124", message, name.span, help=hint)
        return None

    def written(self, section: str) -> dict[str, MappingEntry]:
        """The own entries as they are written, those that are null left out."""
        if section not in self._written:
            entries = entries_of(self._root.get(section))
            self._written[section] = {n: e for n, e in entries.items() if not is_null(e.value)}
        return self._written[section]

    def entry(self, section: str, name: str) -> Mapping:
        """An own entry as it is written."""
        written = self.written(section)[name].value
        assert isinstance(written, Mapping)
        return written

    def _unknown(self, section: str, name: Scalar, library: str) -> Diagnostic:
        if library and library not in self._imports:
            message, names = f"there is no import `{library}`", self._imports
            return Diagnostic("KYB124", message, name.span, help=_import_of(name.text, names))
        what = section.removesuffix("s")
        asking = {own for kind, own in self._open if kind == section}
        known = [other for other in self.names(section) if other not in asking]
        hint = did_you_mean(name.text, known) or f"no other is under `{section}`"
        return Diagnostic("KYB124", f"no {what} is called `{name.text}`", name.span, help=hint)


def _not_there(base: Node | None, own: Node | None, what: str) -> Iterator[Diagnostic]:
    """KYB129 for each of `what` that is removed, and that `like` does not bring."""
    brought = entries_of(base)
    for name, entry in entries_of(own).items():
        if is_null(entry.value) and name not in brought:
            message = f"there is no {what[:-1]} `{name}` to remove"
            hint = did_you_mean(name, brought) or "leave it away"
            warning = Severity.WARNING
            yield Diagnostic("KYB129", message, entry.key.span, help=hint, severity=warning)


def _import_of(name: str, imports: Iterable[str]) -> str:
    """The way out where `name` is of a library that is not imported."""
    library, _, inner = name.rpartition(".")
    near = did_you_mean(library, imports)
    home = installed("kybflow")
    if near.startswith("did") or home is None:
        return near
    root = read_library(LibraryPath(home / "airframes.yaml", "")).source.root
    offered = [entries_of(root.get(s)) for s in SECTIONS] if isinstance(root, Mapping) else []
    if any(inner in entries for entries in offered):
        return f"write `import: {{{library}: {_STANDARD}}}`"
    return near or f"import a library under this name: `import: {{{library}: library/FILE.yaml}}`"


def stack_of(item: Node) -> Scalar | None:
    """The name of the stack that an item of a list stands for; None for a part."""
    name = item.get("stack") if isinstance(item, Mapping) else None
    return name if isinstance(name, Scalar) else None


def chain_of(node: Node) -> Scalar | None:
    """The `do` of a behavior that is a chain; None for any other."""
    do = node.get("do") if isinstance(node, Mapping) else None
    return do if isinstance(do, Scalar) and do.text.startswith("chain.") else None


def _qualified(vehicle: Mapping, library: str) -> Mapping:
    """A vehicle of `library` as the importing file sees it: its chains have the import's name."""
    behaviors = vehicle.entries.get("behaviors")
    if behaviors is None or not isinstance(behaviors.value, Mapping):
        return vehicle
    entries = dict(behaviors.value.entries)
    for name, entry in entries.items():
        do = chain_of(entry.value)
        if do is not None and isinstance(entry.value, Mapping):
            text = f"chain.{library}.{do.text.removeprefix('chain.')}"
            named = entry.value.entries["do"]._replace(value=do._replace(text=text))
            body = Mapping({**entry.value.entries, "do": named}, entry.value.span)
            entries[name] = entry._replace(value=body)
    whole = behaviors._replace(value=Mapping(entries, behaviors.value.span))
    return Mapping({**vehicle.entries, "behaviors": whole}, vehicle.span)

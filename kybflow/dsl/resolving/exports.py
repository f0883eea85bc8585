"""The entries that a file exports. Airframes, vehicles, stacks, worlds and flows are complete:
`like` is resolved, and the parts of a stack replace `- stack: NAME`. Chains remain as written.

`like` starts from another entry: mappings merge, lists are replaced, `null` removes.
"""

from __future__ import annotations

from collections.abc import Iterable

from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import Collector, Span
from kybflow.dsl.language.records import EMPTY
from kybflow.dsl.plan import LISTS
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    entries_of,
    is_null,
    items_of,
)
from kybflow.dsl.resolving.library_files import LibraryPath, installed, read_library
from kybflow.dsl.resolving.parameters import ParameterTable

CODES = {
    "KYB124": "`like`, `airframe`, `stack`, `world` or `do: chain.` names something unknown.",
    "KYB125": "Entries are `like` each other in a cycle, or stacks contain each other.",
    "KYB129": "A mission removes a behavior or phase that it doesn't inherit (a warning).",
    "KYB157": "A stack has nothing for the list that contains it.",
}
_MAX_CHAIN = 20
_STANDARD = "kybflow/airframes"
SECTIONS = ("airframes", "vehicles", "chains", "stacks", "worlds", "flows")
"""The sections that a library exports."""
_REMOVED = {"vehicles": "behaviors", "flows": "phases"}
Places = tuple[Span, ...]
"""The locations of nested uses, outermost first."""


class Exports:
    """The entries that one file exports; each is resolved when it is first needed. root: the file
    with the values of its parameters. parameters: the parameters of the file."""

    def __init__(
        self,
        root: Mapping,
        imports: dict[str, Exports | None],
        base: Mapping,
        parameters: ParameterTable,
        found: Collector,
    ) -> None:
        self.root, self.parameters = root, parameters
        self._imports, self._base, self._found = imports, base, found
        self._done: dict[tuple[str, str], Mapping | None] = {}
        self._qualified: dict[str, Mapping] = {}
        self._written: dict[str, dict[str, MappingEntry]] = {}
        self._open: list[tuple[str, str]] = []

    def names(self, section: str) -> list[str]:
        """Return the names that may be used in the file; those of its imports have the import's
        name in front."""
        imported = [(i, o.written(section)) for i, o in self._imports.items() if o is not None]
        return [*self.written(section), *(f"{i}.{n}" for i, names in imported for n in names)]

    def written(self, section: str) -> dict[str, MappingEntry]:
        """Return the file's own entries as written, without those that are null."""
        if section not in self._written:
            entries = entries_of(self.root.get(section))
            self._written[section] = {n: e for n, e in entries.items() if not is_null(e.value)}
        return self._written[section]

    def entry(self, section: str, name: str) -> Mapping:
        """Return one of the file's own entries as written."""
        written = self.written(section)[name].value
        assert isinstance(written, Mapping)
        return written

    def section(self, section: str) -> Mapping | None:
        """Return a section that this file itself has, its entries completed by those that they are
        `like`; None if the file has no such section."""
        written = self.root.entries.get(section)
        if written is None:
            return None
        whole: dict[str, MappingEntry] = {}
        for name, entry in self.written(section).items():
            body = self.get(section, name)
            if body is not None:
                whole[name] = MappingEntry(entry.key, body)
        return Mapping(whole, written.key.span)

    def get(self, section: str, name: str) -> Mapping | None:
        """Return the complete entry; None if it has errors or doesn't exist."""
        key = (section, name)
        if key not in self._done:
            self._open.append(key)
            self._done[key] = self._whole(section, name)
            self._open.pop()
        return self._done[key]

    def _whole(self, section: str, name: str) -> Mapping | None:
        node = self.root.get(section)
        own = node.get(name) if isinstance(node, Mapping) else None
        if not isinstance(own, Mapping):
            own = EMPTY
        like = own.get("like")
        base: Mapping | None = self._base if section == "vehicles" else EMPTY
        if isinstance(like, Scalar):
            base = self.named(section, like)
        if base is None:
            return None
        plain = Mapping({k: e for k, e in own.entries.items() if k != "like"}, own.span)
        if section in ("vehicles", "stacks"):
            plain = self._with_stacks(plain)
        used = (like.span,) if section == "flows" and isinstance(like, Scalar) else ()
        whole = merge(base, plain, used)
        removed = _REMOVED.get(section, "")
        for inner, entry in entries_of(plain.get(removed)).items():
            brought = entries_of(base.get(removed))
            if is_null(entry.value) and inner not in brought:
                message = f"there is no {removed[:-1]} `{inner}` to remove"
                hint = did_you_mean(inner, brought) or "leave it out"
                self._found.warn("KYB129", message, entry.key.span, help=hint)
        airframe = plain.entries.get("airframe")
        if section == "vehicles" and airframe and whole.get("airframe") is not None:
            body = self.started("airframes", airframe.value, whole.get("airframe"))
            if body is None:
                return None
            whole.entries["airframe"] = MappingEntry(airframe.key, body)
        return whole

    def started(self, section: str, written: Node, plain: Node | None) -> Node | None:
        """Return the entry that `written` names, or starts from with `like`; return `plain` if it
        does neither, and None if it has errors."""
        if isinstance(written, Scalar):
            return self.named(section, written)
        like = written.get("like") if isinstance(written, Mapping) else None
        if not isinstance(written, Mapping) or not isinstance(like, Scalar):
            return plain
        base = self.named(section, like)
        own = {key: entry for key, entry in written.entries.items() if key != "like"}
        return None if base is None else merge(base, Mapping(own, written.span))

    def named(self, section: str, name: Scalar) -> Mapping | None:
        """Return the entry that `name` (`x` or `import.x`) stands for in this file; None if it has
        errors. In an imported vehicle, the names of chains are changed to those valid in this
        file."""
        key = (section, name.text)
        if key in self._open or len(self._open) > _MAX_CHAIN:
            verb = "has" if section == "stacks" else "is like"
            chain = f" {verb} ".join(f"`{n}`" for _, n in (*self._open, key))
            message, hint = f"{chain[:200]}, in a cycle", "remove one of these uses"
            self._found.report("KYB125", message, name.span, help=hint)
            return None
        library, _, inner = name.text.rpartition(".")
        exports = self._imports.get(library) if library else self
        if exports is None and library in self._imports:
            return None
        if exports is None or inner not in exports.written(section):
            self._report_unknown(section, name, library)
            return None
        whole = exports.get(section, inner)
        if whole is None or section != "vehicles" or exports is self:
            return whole
        if name.text not in self._qualified:
            self._qualified[name.text] = _qualified(whole, library)
        return self._qualified[name.text]

    def _with_stacks(self, body: Mapping) -> Mapping:
        """Return a vehicle or a stack with every stack in its lists replaced by its parts. A body
        without stacks is returned unchanged."""
        entries: dict[str, MappingEntry] = {}
        for key in LISTS:
            node = body.get(key)
            if isinstance(node, Sequence) and any(map(stack_of, node.items)):
                items = tuple([part for item in node.items for part in self._parts(key, item)])
                entries[key] = body.entries[key]._replace(value=Sequence(items, node.span))
        return Mapping({**body.entries, **entries}, body.span) if entries else body

    def _parts(self, key: str, item: Node) -> tuple[Node, ...]:
        """Return the parts that an item of the list `key` stands for: the item itself, or those of
        a stack."""
        name = stack_of(item)
        if name is None:
            return (item,)
        stack = self.named("stacks", name)
        own = None if stack is None else stack.get(key)
        if stack is not None and not isinstance(own, Sequence):
            others = " and ".join(other for other in LISTS if stack.get(other) is not None)
            message, hint = f"the stack `{name.text}` has no {key}", f"it has {others or 'nothing'}"
            self._found.report("KYB157", message, name.span, help=hint)
        return items_of(own)

    def chain(self, name: Scalar) -> tuple[Exports, str] | None:
        """Return the file of the chain that `chain.NAME` or `chain.IMPORT.NAME` stands for, and its
        name in that file; report KYB124 and return None if there is none."""
        *libraries, inner = name.text.split(".")[1:]
        exports: Exports = self
        for library in libraries:
            if library not in exports._imports:
                rest = name._replace(text=name.text.removeprefix("chain."))
                self._report_unknown("chains", rest, library)
            imported = exports._imports.get(library)
            if imported is None:
                return None
            exports = imported
        if inner in exports.written("chains"):
            return exports, inner
        known = [f"chain.{own}" for own in self.names("chains")]
        hint = did_you_mean(name.text, known) or "no chain is defined"
        message = f"no chain is called `{name.text.removeprefix('chain.')}`"
        self._found.report("KYB124", message, name.span, help=hint)
        return None

    def _report_unknown(self, section: str, name: Scalar, library: str) -> None:
        if library and library not in self._imports:
            message = f"there is no import `{library}`"
            hint = _import_of(name.text, self._imports)
        else:
            what = section.removesuffix("s")
            asking = {own for kind, own in self._open if kind == section}
            known = [other for other in self.names(section) if other not in asking]
            message = f"no {what} is called `{name.text}`"
            hint = did_you_mean(name.text, known) or f"nothing else is defined under `{section}`"
        self._found.report("KYB124", message, name.span, help=hint)


def _import_of(name: str, imports: Iterable[str]) -> str:
    """Return the hint for a name of a library that is not imported."""
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
    """Return the name of the stack that an item of a list stands for; None for a part."""
    name = item.get("stack") if isinstance(item, Mapping) else None
    return name if isinstance(name, Scalar) else None


def chain_of(node: Node) -> Scalar | None:
    """Return the `do` of a behavior that is a chain; None for any other behavior."""
    do = node.get("do") if isinstance(node, Mapping) else None
    return do if isinstance(do, Scalar) and do.text.startswith("chain.") else None


def _qualified(vehicle: Mapping, library: str) -> Mapping:
    """Return a vehicle of `library` with the import's name in front of the names of its chains."""
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


def merge(base: Mapping, own: Mapping, used: Places = ()) -> Mapping:
    """Return `own` merged over `base`. Entries that come only from `base` are marked as inherited,
    and as used at `used`. The order is that of `base`, followed by what `own` adds."""
    entries = {
        key: MappingEntry(entry.key, entry.value, True, (*used, *entry.used), entry.depth + 1)
        for key, entry in base.entries.items()
    }
    for key, entry in own.entries.items():
        under, value = entries.get(key), entry.value
        if is_null(value):
            entries.pop(key, None)
            continue
        if isinstance(value, Mapping):
            if under is not None and isinstance(under.value, Mapping):
                value = merge(under.value, value, under.used)
            elif _has_null(value):
                value = merge(Mapping({}, value.span), value)
        entries[key] = MappingEntry(entry.key, value)
    return Mapping(entries, own.span)


def _has_null(value: Mapping) -> bool:
    """Return whether the mapping contains a null at any depth. One without null is not copied, so
    that it stays shared."""
    return any(
        is_null(entry.value) or (isinstance(entry.value, Mapping) and _has_null(entry.value))
        for entry in value.entries.values()
    )


class UseMarker:
    """Copies nodes so that their spans record the locations where `like` or a chain uses them. A
    node that aliases share is copied once."""

    def __init__(self) -> None:
        self._done: dict[tuple[int, Places], tuple[Node, Node]] = {}

    def marked(self, node: Node, used: Places = ()) -> Node:
        """Return a copy of `node` whose spans contain the locations `used`."""
        key = (id(node), used)
        if key not in self._done:
            self._done[key] = (node, self._copied(node, used))
        return self._done[key][1]

    def _copied(self, node: Node, used: Places) -> Node:
        span = node.span._replace(used=used) if used else node.span
        if isinstance(node, Scalar):
            return node._replace(span=span) if used else node
        if isinstance(node, Sequence):
            items = tuple(self.marked(item, used) for item in node.items) if used else node.items
            return Sequence(items, span)
        entries: dict[str, MappingEntry] = {}
        for name, entry in node.entries.items():
            places, key = (*used, *entry.used), entry.key
            if places:
                key = key._replace(span=key.span._replace(used=places))
            value = self.marked(entry.value, places)
            entries[name] = MappingEntry(key, value, entry.inherited, depth=entry.depth)
        return Mapping(entries, span)

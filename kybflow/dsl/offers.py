"""What a file offers: its airframes and vehicles, each whole after `like`."""

from __future__ import annotations

from collections.abc import Iterable

from kybflow.dsl.diagnostics import Diagnostic, did_you_mean
from kybflow.dsl.imports import Place, installed, read_library
from kybflow.dsl.like import merge
from kybflow.dsl.nodes import Entry, Mapping, Node, Scalar, entries_of
from kybflow.dsl.source import Span

_CHAIN = 20
EMPTY = Mapping({}, Span("", 1, 1, 1, 1))
_STANDARD = "kybflow/airframes"
_SECTIONS = ("airframes", "vehicles")


class Offers:
    """The airframes and vehicles of one file, whole; each is resolved when first asked for."""

    def __init__(
        self,
        root: Mapping,
        imports: dict[str, Offers | None],
        base: Mapping,
        found: list[Diagnostic],
    ) -> None:
        self._root = root
        self._imports = imports
        self._base = base
        self._found = found
        self._done: dict[tuple[str, str], Mapping | None] = {}
        self._open: list[tuple[str, str]] = []

    def own(self, section: str) -> list[str]:
        """The names that the file itself has in `section`."""
        node = self._root.get(section)
        return list(node.entries) if isinstance(node, Mapping) else []

    def names(self, section: str) -> list[str]:
        """The names that may be used in the file, those of its imports qualified."""
        imported = ((i, o.own(section)) for i, o in self._imports.items() if o is not None)
        return self.own(section) + [f"{i}.{n}" for i, names in imported for n in names]

    def get(self, section: str, name: str) -> Mapping | None:
        """The whole entry; None when it has errors or doesn't exist."""
        key = (section, name)
        if key not in self._done:
            self._open.append(key)
            self._done[key] = self._whole(section, name)
            self._open.pop()
        return self._done[key]

    def _whole(self, section: str, name: str) -> Mapping | None:
        node = self._root.get(section)
        own = node.get(name) if isinstance(node, Mapping) else None
        if not isinstance(own, Mapping):
            own = EMPTY
        like = own.get("like")
        base = self._base if section == "vehicles" else EMPTY
        if isinstance(like, Scalar):
            found = self.named(section, like)
            if found is None:
                return None
            base = found
        plain = Mapping({k: e for k, e in own.entries.items() if k != "like"}, own.span)
        whole = merge(base, plain)
        airframe = plain.entries.get("airframe")
        if section == "vehicles" and airframe and whole.get("airframe") is not None:
            body = self._airframe(airframe.value, whole)
            if body is None:
                return None
            whole.entries["airframe"] = Entry(airframe.key, body)
        return whole

    def _airframe(self, written: Node, whole: Mapping) -> Node | None:
        """The airframe of a vehicle: the one that is named, or started from with `like`."""
        if isinstance(written, Scalar):
            return self.named("airframes", written)
        like = written.get("like") if isinstance(written, Mapping) else None
        if not isinstance(written, Mapping) or not isinstance(like, Scalar):
            return whole.get("airframe")
        base = self.named("airframes", like)
        own = {key: entry for key, entry in written.entries.items() if key != "like"}
        return None if base is None else merge(base, Mapping(own, written.span))

    def named(self, section: str, name: Scalar) -> Mapping | None:
        """The entry that `name` (`x`, or `import.x`) means here."""
        key = (section, name.text)
        if key in self._open or len(self._open) > _CHAIN:
            chain = " is like ".join(f"`{n}`" for _, n in (*self._open, key))
            self._found.append(Diagnostic("KYB125", f"{chain[:200]}: this never ends", name.span))
            return None
        library, _, inner = name.text.rpartition(".")
        if library in self._imports:
            offers = self._imports[library]
            if offers is None or inner in offers.own(section):
                return None if offers is None else offers.get(section, inner)
        elif not library and inner in self.names(section):
            return self.get(section, inner)
        self._found.append(self._unknown(section, name, library))
        return None

    def _unknown(self, section: str, name: Scalar, library: str) -> Diagnostic:
        if library and library not in self._imports:
            message, names = f"there is no import `{library}`", self._imports
            return Diagnostic("KYB124", message, name.span, help=_import_of(name.text, names))
        what = section.removesuffix("s")
        asking = {own for kind, own in self._open if kind == section}
        known = [other for other in self.names(section) if other not in asking]
        hint = did_you_mean(name.text, known) or f"no other is under `{section}`"
        return Diagnostic("KYB124", f"no {what} is called `{name.text}`", name.span, help=hint)


def _import_of(name: str, imports: Iterable[str]) -> str:
    """The way out where `name` is of a library that is not imported."""
    library, _, inner = name.rpartition(".")
    near = did_you_mean(library, imports)
    home = installed("kybflow")
    if near.startswith("did") or home is None:
        return near
    root = read_library(Place(home / "airframes.yaml", "")).source.root
    offered = [entries_of(root.get(s)) for s in _SECTIONS] if isinstance(root, Mapping) else []
    if any(inner in entries for entries in offered):
        return f"write `import: {{{library}: {_STANDARD}}}`"
    return near or f"import a library under this name: `import: {{{library}: library/FILE.yaml}}`"

"""What a file offers: its airframes, vehicles, stacks, worlds and flows, each whole after `like`;
its chains as they are written."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity, did_you_mean
from kybflow.dsl.reading.nodes import Entry, Mapping, Node, Scalar, entries_of, is_null
from kybflow.dsl.reading.source import Span
from kybflow.dsl.resolving.chain_nodes import qualified
from kybflow.dsl.resolving.imports import Place, installed, read_library
from kybflow.dsl.resolving.like import merge
from kybflow.dsl.resolving.parameters import Parameters
from kybflow.dsl.resolving.stacks import with_stacks

_CHAIN = 20
EMPTY = Mapping({}, Span("", 1, 1, 1, 1))
_STANDARD = "kybflow/airframes"
SECTIONS = ("airframes", "vehicles", "chains", "stacks", "worlds", "flows")
"""What a library offers."""
_REMOVED = {"vehicles": "behaviors", "flows": "phases"}


class Offers:
    """What one file offers, whole; each entry is resolved when first asked for."""

    def __init__(
        self,
        root: Mapping,
        imports: dict[str, Offers | None],
        base: Mapping,
        found: list[Diagnostic],
        parameters: Parameters,
    ) -> None:
        self._root = root
        self._imports = imports
        self._base = base
        self._found = found
        self.parameters = parameters
        self._done: dict[tuple[str, str], Mapping | None] = {}
        self._qualified: dict[tuple[str, str], Mapping] = {}
        self._written: dict[str, dict[str, Entry]] = {}
        self._open: list[tuple[str, str]] = []

    def own(self, section: str) -> list[str]:
        """The names that the file itself has in `section`."""
        return list(self.written(section))

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
        if section in ("vehicles", "stacks"):
            plain = with_stacks(plain, self._stack, self._found)
        used = (like.span,) if section == "flows" and isinstance(like, Scalar) else ()
        whole = merge(base, plain, used)
        removed = _REMOVED.get(section)
        if removed is not None:
            self._found += _not_there(base.get(removed), plain.get(removed), removed)
        airframe = plain.entries.get("airframe")
        if section == "vehicles" and airframe and whole.get("airframe") is not None:
            body = self.started("airframes", airframe.value, whole.get("airframe"))
            if body is None:
                return None
            whole.entries["airframe"] = Entry(airframe.key, body)
        return whole

    def started(self, section: str, written: Node, plain: Node | None) -> Node | None:
        """An entry of `section` in its place: the one that is named, or started from with `like`;
        `plain` where it is neither. None when it has errors."""
        if isinstance(written, Scalar):
            return self.named(section, written)
        like = written.get("like") if isinstance(written, Mapping) else None
        if not isinstance(written, Mapping) or not isinstance(like, Scalar):
            return plain
        base = self.named(section, like)
        own = {key: entry for key, entry in written.entries.items() if key != "like"}
        return None if base is None else merge(base, Mapping(own, written.span))

    def named(self, section: str, name: Scalar) -> Mapping | None:
        """The entry that `name` (`x`, or `import.x`) means here."""
        key = (section, name.text)
        if key in self._open or len(self._open) > _CHAIN:
            verb = "has" if section == "stacks" else "is like"
            chain = f" {verb} ".join(f"`{n}`" for _, n in (*self._open, key))
            self._found.append(Diagnostic("KYB125", f"{chain[:200]}: this never ends", name.span))
            return None
        library, _, inner = name.text.rpartition(".")
        if library in self._imports:
            offers = self._imports[library]
            if offers is None or inner in offers.written(section):
                return None if offers is None else self._imported(section, library, inner, offers)
        elif not library and inner in self.written(section):
            return self.get(section, inner)
        self._found.append(self._unknown(section, name, library))
        return None

    def _stack(self, name: Scalar) -> Mapping | None:
        return self.named("stacks", name)

    def _imported(self, section: str, library: str, name: str, offers: Offers) -> Mapping | None:
        """An entry of an import; the chains that a vehicle names are called as they are here."""
        whole = offers.get(section, name)
        if whole is None or section != "vehicles":
            return whole
        key = (library, name)
        if key not in self._qualified:
            self._qualified[key] = qualified(whole, library)
        return self._qualified[key]

    def chain(self, name: Scalar) -> tuple[Offers, str] | None:
        """(the file, the name in it) of the chain that `chain.NAME` or `chain.IMPORT.NAME` means
        here; None, and a finding, where there is none."""
        *libraries, inner = name.text.split(".")[1:]
        offers: Offers = self
        for library in libraries:
            found = offers._imports.get(library)
            if library not in offers._imports:
                rest = name._replace(text=name.text.removeprefix("chain."))
                self._found.append(self._unknown("chains", rest, library))
            if found is None:
                return None
            offers = found
        if inner in offers.own("chains"):
            return offers, inner
        known = [f"chain.{own}" for own in self.names("chains")]
        hint = did_you_mean(name.text, known) or "no chain is at hand"
        message = f"no chain is called `{name.text.removeprefix('chain.')}`"
        self._found.append(Diagnostic("KYB124", message, name.span, help=hint))
        return None

    def written(self, section: str) -> dict[str, Entry]:
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
    root = read_library(Place(home / "airframes.yaml", "")).source.root
    offered = [entries_of(root.get(s)) for s in SECTIONS] if isinstance(root, Mapping) else []
    if any(inner in entries for entries in offered):
        return f"write `import: {{{library}: {_STANDARD}}}`"
    return near or f"import a library under this name: `import: {{{library}: library/FILE.yaml}}`"

"""`kybflow library`: the libraries and missions that installed packages ship, and one of them."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import entry_points
from itertools import takewhile
from pathlib import Path

from kybflow.dsl.diagnostics.diagnostic import did_you_mean
from kybflow.dsl.reading.nodes import Entry, Mapping, Node, Scalar, entries_of
from kybflow.dsl.reading.reader import Source, read
from kybflow.dsl.resolving.imports import GROUP, installed
from kybflow.dsl.resolving.offers import SECTIONS

OWN = "kybflow"
"""The package whose missions need no package before their name."""


@dataclass(frozen=True, slots=True)
class Shipped:
    """A file that an installed package ships, as it is called: what missions import or start
    from."""

    name: str
    source: Source
    path: Path

    @property
    def summary(self) -> str:
        return _text(self.root.get("summary")) if self.root else ""

    @property
    def root(self) -> Mapping | None:
        """Its top level; None where it can't be read."""
        root = self.source.root
        return root if isinstance(root, Mapping) else None

    def entries(self) -> Iterator[tuple[str, str, Entry]]:
        """(section, name, entry) of everything that it offers."""
        for section in SECTIONS if self.root else ():
            for name, entry in entries_of(self.root.get(section)).items() if self.root else ():
                yield section, name, entry


def libraries() -> list[Shipped]:
    """The libraries of every package."""
    return [
        read_file(f"{package}/{path.stem}", path)
        for package, folder in _homes()
        for path in sorted(folder.glob("*.yaml"))
    ]


def missions() -> list[Shipped]:
    """The missions of every package; those of others than kybflow with its name before theirs."""
    return [
        read_file(path.stem if package == OWN else f"{package}/{path.stem}", path)
        for package, folder in _homes()
        for path in sorted(folder.parent.glob("*.yaml"))
    ]


def _homes() -> Iterator[tuple[str, Path]]:
    names = dict.fromkeys([OWN, *sorted(entry.name for entry in entry_points(group=GROUP))])
    for name in names:
        home = installed(name)
        if home is not None:
            yield name, home


def read_file(name: str, path: Path) -> Shipped:
    """The file at `path`, called `name`."""
    return Shipped(name, read(path, str(path)), path)


def list_shipped() -> str:
    """Everything at hand, by file."""
    blocks = ["\n".join(contents(one)) for one in libraries()]
    shipped = missions()
    width = max((len(one.name) for one in shipped), default=0)
    rows = [f"  {one.name:<{width}}  {one.summary}".rstrip() for one in shipped]
    return "\n\n".join([*blocks, "\n".join(["missions, for `kybflow new NAME --from`", *rows])])


def contents(one: Shipped) -> Iterator[str]:
    """The name of a file and what it offers, a line each."""
    yield f"{one.name}  {one.summary}".rstrip()
    by_section: dict[str, list[str]] = {}
    for section, name, entry in one.entries():
        by_section.setdefault(section, []).append(f"{name}{_signature(entry.value)}")
    if one.root and one.root.get("parameters") is not None:
        by_section["with"] = [_signature(one.root)[1:-1]]
    for section, names in by_section.items():
        yield f"  {section:<9}  {', '.join(names)}"


def _signature(node: Node) -> str:
    """The parameters of a chain or a library in brackets, with their defaults; nothing where it has
    none."""
    parameters = entries_of(node.get("parameters")) if isinstance(node, Mapping) else {}
    shown = []
    for name, entry in parameters.items():
        body = entry.value if isinstance(entry.value, Mapping) else None
        default = _text(body.get("default")) if body else ""
        shown.append(f"{name} = {default}" if default else name)
    return f"({', '.join(shown)})" if shown else ""


def _text(node: Node | None) -> str:
    return node.text if isinstance(node, Scalar) else ""


def show_shipped(name: str) -> str | None:
    """The text of the file called `name`, or of every entry of that name; None when there is
    none."""
    for one in (*libraries(), *missions()):
        if name in (one.name, one.name.removeprefix(f"{OWN}/")):
            return f"# {one.path}\n{one.source.text}".rstrip()
    found = [
        entry_text(one, section, entry)
        for one in libraries()
        for section, own, entry in one.entries()
        if name in (own, f"{one.name}.{own}")
    ]
    return "\n\n".join(found) or None


def entry_text(one: Shipped, section: str, entry: Entry) -> str:
    """The lines of an entry; a block of YAML ends before what is indented as its key is."""
    key = entry.key.span
    first, *rest = one.source.text.split("\n")[key.line - 1 : entry.value.span.end_line]
    inside = list(takewhile(lambda line: line[: key.column].isspace() or not line, rest))
    text = textwrap.dedent("\n".join([first, *inside])).rstrip()
    return f"# {section[:-1]} of {one.name}\n{text}"


def unknown_name(name: str) -> str:
    """What to say of a name that nothing has."""
    known = [one.name for one in (*libraries(), *missions())]
    known += [own for one in libraries() for _, own, _ in one.entries()]
    return f"nothing at hand is called `{name}`; {did_you_mean(name, known)}"

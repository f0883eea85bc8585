"""Packages with missions or parts, as if they were installed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path


def installed(folder: Path, name: str, offers: str, files: Mapping[str, str]) -> None:
    """Install package `name` with these files into `folder`. offers: its entry points of kybflow,
    such as `missions` or `parts`, and the module that has them."""
    group, module = offers.split()
    info = f"{name}-1.0.dist-info"
    metadata = {
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n",
        f"{info}/entry_points.txt": f"[kybflow.{group}]\n{name} = {module}\n",
    }
    for path, text in {**metadata, **files}.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")


def package(folder: Path, name: str, library: str | None) -> None:
    """Install package `name`, which offers missions, into `folder`; its one library file is
    `library`, None for a package without the files that it promises."""
    quads = f"{name}/missions/library/quads.yaml"
    files = {} if library is None else {f"{name}/__init__.py": "", quads: library}
    installed(folder, name, f"missions {name}.missions", files)

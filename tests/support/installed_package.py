"""A package with a library of missions, as if it were installed."""

from __future__ import annotations

from pathlib import Path


def package(folder: Path, name: str, library: str | None) -> None:
    """Install package `name`, which offers missions, into `folder`; its one library file is
    `library`, None for a package without the files that it promises."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[kybflow.missions]\n{name} = {name}.missions\n")
    if library is not None:
        (folder / name / "missions" / "library").mkdir(parents=True)
        (folder / name / "__init__.py").write_text("")
        (folder / name / "missions" / "library" / "quads.yaml").write_text(library)

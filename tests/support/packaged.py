"""A package that ships a library, as installed, for tests."""

from __future__ import annotations

from pathlib import Path


def package(folder: Path, name: str, library: str | None) -> None:
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[kybflow.missions]\n{name} = {name}.missions\n")
    if library is not None:
        (folder / name / "missions" / "library").mkdir(parents=True)
        (folder / name / "__init__.py").write_text("")
        (folder / name / "missions" / "library" / "quads.yaml").write_text(library)

"""What mypyc drops from a module is read from the source beside it."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

from kybflow.core.errors import PartError
from kybflow.core.params import fields_of, param, params, type_of
from kybflow.core.sources import docstring_of
from kybflow.core.units import Length, Speed

SOURCE = '''"""Nod politely."""

from kybflow.core.units import Length, Speed

@params
class NodParams:
    depth: Length = param("How far.", default=0.1)
    speeds: Speed | None = param("How fast.", default=None)
'''


def compiled_module(folder: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """A module as mypyc leaves it: no docstring, and annotations that are plain types."""
    module = ModuleType("nod")
    module.__file__ = str(folder / "nod.cpython-311-x86_64-linux-gnu.so")
    module.Length, module.Speed = Length, Speed  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "nod", module)
    return module


def nod_params() -> type:
    declared = {
        "__module__": "nod",
        "__annotations__": {"depth": float, "speeds": type},
        "depth": param("How far.", default=0.1),
        "speeds": param("How fast.", default=None),
    }
    return params(type("NodParams", (), declared))


def test_a_compiled_module_has_the_docstring_of_its_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    compiled_module(tmp_path, monkeypatch)
    (tmp_path / "nod.py").write_text(SOURCE, encoding="utf-8")
    assert docstring_of("nod") == "Nod politely."


def test_its_parameters_have_the_units_of_its_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    compiled_module(tmp_path, monkeypatch)
    (tmp_path / "nod.py").write_text(SOURCE, encoding="utf-8")
    depth, speeds = fields_of(nod_params())
    assert type_of(depth) == "length [m]"
    assert type_of(speeds) == "speed [m/s]"
    assert speeds.optional


def test_units_are_inherited_from_a_compiled_class(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    compiled_module(tmp_path, monkeypatch)
    (tmp_path / "nod.py").write_text(SOURCE, encoding="utf-8")

    @params
    class Deeper(nod_params()):  # type: ignore[misc]
        length: Length = param("How long.", default=1.0)

    assert [type_of(f) for f in fields_of(Deeper)] == ["length [m]", "speed [m/s]", "length [m]"]


def test_without_its_source_it_has_neither(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    compiled_module(tmp_path, monkeypatch)
    assert docstring_of("nod") == ""
    with pytest.raises(PartError, match=r"nod\.NodParams\.depth: a parameter can't have the type"):
        fields_of(nod_params())

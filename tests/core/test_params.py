"""`@params` and the catalog: a declaration is read once, and a wrong one says where."""

from typing import Literal

import pytest

from kybflow.core.errors import PartError
from kybflow.core.params import RESERVED, fields_of, param, params
from kybflow.core.units import LENGTH, Length, Path, Position
from kybflow.parts.catalog import Catalog, load_catalog


@params
class Example:
    place: Position = param("Where.")
    keep: Length | None = param("How far.", default=None, above=0.0, at_most=2.0)
    how: Literal["slow", "fast"] = param("How.", default="slow", read_only=True)
    way: Path = param("Corners.", default=())
    count: int = param("How often.", default=1, at_least=1)


def test_a_declaration_is_read_into_fields():
    place, keep, how, way, count = fields_of(Example)
    assert (place.shape, place.dimension, place.required) == ("vector", LENGTH, True)
    assert (keep.shape, keep.optional, keep.default) == ("scalar", True, None)
    assert (how.shape, how.choices, how.read_only) == ("choice", ("slow", "fast"), True)
    assert way.shape == "path"
    assert count.shape == "integer"


@pytest.mark.parametrize(
    ("value", "broken"), [(0.0, "must be above 0"), (3.0, "must be at most 2"), (1.0, None)]
)
def test_bounds_are_told_in_words(value, broken):
    assert fields_of(Example)[1].outside(value) == broken


def test_a_parameter_may_not_have_a_key_of_the_language():
    @params
    class Wrong:
        within: Length = param("Taken.", default=1.0)

    with pytest.raises(PartError, match="may not be called `within`"):
        fields_of(Wrong)


def test_a_parameter_needs_a_type_with_a_unit():
    @params
    class Wrong:
        speed: float = param("No unit.", default=1.0)

    with pytest.raises(PartError, match=r"use the types of kybflow\.core\.units"):
        fields_of(Wrong)


def test_a_text_may_be_the_name_of_a_vehicle():
    @params
    class Named:
        other: str = param("Another vehicle.", names="vehicle")
        note: str = param("Any text.", default="")

    assert [field.names for field in fields_of(Named)] == ["vehicle", None]


@pytest.mark.parametrize("name", ["at", "on", "inject", "when"])
def test_the_keys_of_a_fault_are_no_parameters(name: str):
    assert name in RESERVED


def test_a_field_needs_param():
    @params
    class Wrong:
        speed: Length = 1.0

    with pytest.raises(PartError, match=r"declared without `param"):
        fields_of(Wrong)


def test_names_are_listed_without_importing():
    catalog = Catalog({"behaviors": {"broken": "no.such.module"}})
    assert catalog.names("behaviors") == ("broken",)
    with pytest.raises(PartError, match=r"no\.such\.module can't be imported"):
        catalog.get("behaviors", "broken")


def test_the_supervisors_that_every_vehicle_has():
    always = {spec.name for spec in load_catalog().always("supervisors")}
    assert always >= {"fence", "estimate", "battery"}

"""`@params` and the catalog: a declaration is read once, and a wrong one says where."""

from typing import Literal

import pytest

from kybflow.core.errors import PartError
from kybflow.core.params import fields_of, param, params, type_of
from kybflow.core.units import DAMPING, LENGTH, Damping, Length, Matrix, Path, Position
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


@params
class Coupled:
    gain: Matrix[Literal[2], Literal[3], Damping] = param(
        "How fast.", default=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), at_most=2.0, tightens="down"
    )
    same: Matrix[2, 2, Damping] | None = param("Both ways.", default=None, is_definite=True)


def test_a_matrix_is_declared_by_its_rows_columns_and_unit():
    gain, same = fields_of(Coupled)
    assert (gain.shape, gain.type.size, gain.dimension) == ("matrix", (2, 3), DAMPING)
    assert (same.shape, same.type.size, same.optional) == ("matrix", (2, 2), True)
    assert not gain.type.fixed
    assert type_of(gain) == "2 x 3 matrix of rate constant [1/s]"
    assert type_of(same) == "positive definite 2 x 2 matrix of rate constant [1/s]"


def test_the_numbers_of_a_matrix_go_along_its_rows():
    gain = fields_of(Coupled)[0]
    assert gain.numbers(((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


@pytest.mark.parametrize(
    ("after", "is_looser"),
    [
        (((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), False),
        (((0.5, -1.0, 0.0), (0.0, 0.5, 0.0)), False),
        (((0.5, 0.0, 0.0), (0.0, 0.5, 0.1)), True),
    ],
)
def test_a_matrix_is_loosened_by_any_of_its_numbers(after, is_looser):
    gain = fields_of(Coupled)[0]
    assert gain.loosens(gain.default, after) is is_looser


@pytest.mark.parametrize(
    ("value", "flaw"),
    [
        (None, None),
        (((2.0, 1.0), (1.0, 2.0)), None),
        (
            ((2.0, 1.0), (0.5, 2.0)),
            "must be symmetric, but row 1 has 1 in column 2 and row 2 has 0.5 in column 1",
        ),
        (((1.0, 2.0), (2.0, 1.0)), "must be positive definite, with every eigenvalue above 0"),
        (((1.0, 0.0), (0.0, 0.0)), "must be positive definite, with every eigenvalue above 0"),
    ],
)
def test_a_matrix_that_is_not_positive_definite_says_why(value, flaw):
    gain, same = fields_of(Coupled)
    assert same.flaw(value) == flaw
    assert gain.flaw(value) is None


def test_only_a_square_matrix_is_positive_definite():
    @params
    class Wide:
        gain: Matrix[2, 3, Damping] = param("No square.", is_definite=True)

    @params
    class Single:
        gain: Damping = param("No matrix.", is_definite=True)

    for wrong in (Wide, Single):
        with pytest.raises(PartError, match="only a square matrix"):
            fields_of(wrong)


@pytest.mark.parametrize("of", [(3, Damping), (3, 0, Damping), (3, 3, float), (3, 3, Position), 3])
def test_a_matrix_that_is_declared_otherwise_says_how(of):
    with pytest.raises(PartError, match=r"declared like `Matrix\[3, 3, Damping\]`"):
        Matrix[of]


@pytest.mark.parametrize(
    ("value", "is_within"), [(0.0, False), (3.0, False), (float("nan"), False), (1.0, True)]
)
def test_a_value_is_within_its_bounds(value, is_within):
    assert fields_of(Example)[1].is_within(value) is is_within


@pytest.mark.parametrize(
    ("key", "kind", "why"),
    [
        *(
            (k, Length, f"may not be called `{k}`")
            for k in ("within", "at", "on", "inject", "when")
        ),
        ("speed", float, r"use the types of kybflow\.core\.units"),
    ],
)
def test_a_parameter_has_a_type_with_a_unit_and_no_key_of_the_language(key, kind, why):
    wrong = type("Wrong", (), {"__annotations__": {key: kind}, key: param("Some.", default=1.0)})
    with pytest.raises(PartError, match=why):
        fields_of(params(wrong))


def test_a_text_may_be_the_name_of_a_vehicle():
    @params
    class Named:
        other: str = param("Another vehicle.", names="vehicle")
        note: str = param("Any text.", default="")

    assert [field.names for field in fields_of(Named)] == ["vehicle", None]


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

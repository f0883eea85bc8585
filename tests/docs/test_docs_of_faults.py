"""The language page has every fault, with its parameters and its own words."""

import pytest
from toolchain import ROOT

from kybflow.parts.catalog import load_catalog

PAGE = ROOT / "docs" / "mission-language.md"


@pytest.mark.parametrize("name", load_catalog().names("faults"))
def test_the_language_page_has_the_fault(name: str) -> None:
    spec = load_catalog().get("faults", name)
    parameters = ", ".join(f"`{field.name}`" for field in spec.fields)
    row = f"| `{name}` | {parameters} | {spec.summary} |"
    assert row in PAGE.read_text(encoding="utf-8").splitlines()

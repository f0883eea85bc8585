"""Parts that can't be loaded are findings, not tracebacks."""

from __future__ import annotations

from pathlib import Path

import pytest

from kybflow.dsl.diagnostics import Collector, Span
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.reading.nodes import Scalar
from kybflow.parts.catalog import Catalog


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ('"""A part."""\nimport a_package_that_is_not_here\n', "a_package_that_is_not_here"),
        (
            '"""A part."""\n',
            "should define the class `Spiral(Behavior[...])` or `SpiralBehavior(Behavior[...])`",
        ),
    ],
)
def test_a_broken_part_is_kyb141(
    body: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = f"kyb_part_{abs(hash(body))}"
    (tmp_path / f"{module}.py").write_text(body)
    monkeypatch.syspath_prepend(tmp_path)
    catalog = Catalog({"behaviors": {"spiral": module}})
    place = Span("m.yaml", 1, 1, 1, 7)
    found = Collector()
    part = Decoder(catalog, found).part("behaviors", Scalar("spiral", place))
    assert part is None
    assert [(d.code, d.span) for d in found.all] == [("KYB141", place)]
    assert reason in found.all[0].message

"""The catalog tells what is wrong with a package that offers parts."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from kybflow.core.errors import PartError
from kybflow.parts import catalog


@pytest.mark.parametrize(
    ("body", "reason"), [("import no_such_thing", "no_such_thing"), ("1 / 0", "division by zero")]
)
def test_a_package_that_cannot_be_imported_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, reason: str
) -> None:
    name = "broken_lab_" + reason.replace(" ", "_")
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text(body)
    monkeypatch.syspath_prepend(tmp_path)
    entry = EntryPoint("lab", name, catalog.GROUP)
    monkeypatch.setattr(catalog, "entry_points", lambda group: [entry])
    with pytest.raises(PartError, match=f"{name}.*{reason}"):
        catalog.load_catalog.__wrapped__()

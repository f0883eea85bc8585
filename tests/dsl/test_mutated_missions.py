"""No mutated mission gives a traceback: the text and the tree of a good one, changed at random."""

from __future__ import annotations

from pathlib import Path

import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from kybflow.dsl.compiler import Result, compile_mission
from kybflow.dsl.diagnostics.render import render, to_json
from kybflow.parts.catalog import load_catalog

REPO = Path(__file__).parents[2]
TEXT = (REPO / "missions" / "figure_eight.yaml").read_text(encoding="utf-8")
TREE = yaml.safe_load(TEXT)
NOISE = st.text(alphabet="[]{}:,-&*!|>'\"%@`#?$ \n\tabz019.é\x85\u2028", max_size=8)
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.sampled_from(["$lap", "$none", "1 m", "3 s", "hover", "std.nano_plus", "mk", "a and b", ""]),
    st.text(max_size=6),
    st.lists(st.integers(), max_size=4),
    st.dictionaries(st.sampled_from(["do", "use", "like", "then", "go", "x"]), st.text(max_size=3)),
)


def compiled(text: str, folder: Path) -> Result:
    path = folder / "mission.yaml"
    path.write_text(text, encoding="utf-8", errors="surrogatepass", newline="")
    return compile_mission(path, catalog=load_catalog())


def check(result: Result) -> None:
    """A plan or an error, and every finding can be shown."""
    assert result.valid == (result.plan is not None)
    for diagnostic in result.diagnostics:
        assert f"[{diagnostic.code}]: " in render(diagnostic, result.texts)
        assert to_json(diagnostic)["line"] >= 1


@given(st.data())
@settings(max_examples=100, suppress_health_check=[HealthCheck.too_slow])
def test_changed_text(tmp_path_factory, data) -> None:
    text = TEXT.replace("library/airframes.yaml", "kybflow/airframes")
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        end = start + data.draw(st.integers(0, 12))
        text = text[:start] + data.draw(NOISE) + text[end:]
    check(compiled(text, tmp_path_factory.getbasetemp()))


@given(st.data())
@settings(max_examples=100, suppress_health_check=[HealthCheck.too_slow])
def test_changed_tree(tmp_path_factory, data) -> None:
    tree = yaml.safe_load(TEXT)
    tree["import"] = {"std": "kybflow/airframes"}
    node = tree
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        key = data.draw(st.sampled_from(keys))
        inner = node[key]
        if not isinstance(inner, dict | list) or not inner or data.draw(st.integers(0, 3)) == 0:
            break
        node = inner
    change = data.draw(st.sampled_from(["remove", "replace", "rename"]))
    if change == "remove":
        del node[key]
    elif change == "replace" or isinstance(node, list):
        node[key] = data.draw(VALUES)
    else:
        node[data.draw(st.text(max_size=5))] = node.pop(key)
    text = yaml.safe_dump(tree, allow_unicode=True, sort_keys=False)
    check(compiled(text, tmp_path_factory.getbasetemp()))


@given(st.text(max_size=12), st.text(max_size=8))
@settings(max_examples=100, suppress_health_check=[HealthCheck.too_slow])
def test_any_setting(name: str, value: str) -> None:
    path = REPO / "missions" / "figure_eight.yaml"
    for text in (f"{name}={value}", f"lap={value}", name):
        check(compile_mission(path, catalog=load_catalog(), sets=[text]))

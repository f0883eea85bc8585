"""The shape of a file, judged before anything is resolved: by the records (`shape`), and what they
don't take by `jsonschema`, which says what is wrong, in our words.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Findings
from kybflow.dsl.language.explain import SchemaViolation, explain
from kybflow.dsl.language.schema import record_schema
from kybflow.dsl.language.shape import has_shape
from kybflow.dsl.plan import Plan
from kybflow.dsl.reading.nodes import Mapping, Node, Sequence, describe, head_of, to_json

if TYPE_CHECKING:
    from jsonschema.protocols import Validator


def judge_file(root: Node, kind: Any) -> list[Diagnostic]:
    """What is wrong with the shape of a whole file, a `Plan` or a `Library`."""
    return [] if has_shape(root, kind) else explained(root, _validator(kind))


@functools.cache
def _validator(kind: Any) -> Validator:
    from jsonschema import Draft202012Validator  # takes longer to import than all else in `dsl`

    return Draft202012Validator(record_schema(kind))


def explained(root: Node, validator: Validator) -> list[Diagnostic]:
    """What `validator` finds wrong with `root`, in our words."""
    found: list[Diagnostic] = []
    for error in validator.iter_errors(to_json(root)):
        node, name = _locate(root, error.absolute_path)
        schema = error.schema if isinstance(error.schema, dict) else {}
        keyword, wanted = str(error.validator), error.validator_value
        found += explain(SchemaViolation(keyword, wanted, error.instance, schema, node, name))
    return found


def is_library(root: Node) -> bool:
    """Whether the file offers things to missions instead of being one."""
    return isinstance(root, Mapping) and "library" in root.entries and "mission" not in root.entries


def judge_mission(root: Node, found: Findings) -> Mapping:
    """The top level of a mission; reports what is wrong with its shape."""
    if isinstance(root, Mapping) and "mission" in root.entries:
        found.add(judge_file(root, Plan))
        return root
    what = f"this is {describe(root)}" if not isinstance(root, Mapping) else "`mission` is missing"
    hint = "a mission begins with `kybflow: 1` and `mission: NAME`"
    found.report("KYB102", f"a mission is needed, but {what}", head_of(root), help=hint)
    return Mapping({}, root.span)


def _locate(root: Node, path: Any) -> tuple[Node, str]:
    """The node at `path` and the name by which a person would call it."""
    node, name = root, ""
    for step in path:
        if isinstance(node, Mapping):
            node, name = node.entries[step].value, step
        elif isinstance(node, Sequence):
            node, name = node.items[step], name if name.endswith("]") else f"{name}[{step}]"
    return node, name

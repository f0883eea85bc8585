"""The engine under the mission language: from the declaration of a record follow its decoder, its
JSON Schema, its text and its rows in the docs. The records themselves are in `kybflow.dsl.plan` and
`kybflow.dsl.world`. Knows no key and no part by name.
"""

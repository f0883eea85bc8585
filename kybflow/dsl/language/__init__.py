"""The engine under the mission language: from the declaration of a record follow its decoder, its
shape, its JSON Schema, its text and its rows in the docs. The records themselves are in
`kybflow.dsl.plan` and `kybflow.dsl.world`. `text`, `judge` and `published` name the few keys that
are written, worded or completed in a way of their own.
"""

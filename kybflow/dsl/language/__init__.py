"""The engine of the mission language: it derives the decoder, the shape check, the JSON Schema, the
text and the rows in the docs from the declaration of a record. The records are in
`kybflow.dsl.plan` and `kybflow.dsl.world`. `text`, `judge` and `published` name the few keys that
need code of their own."""

"""The engine of the mission language. From the declaration of a record it derives the decoder, the
shape check, the JSON Schema, the text and the rows in the docs. The records are in
`kybflow.dsl.plan` and `kybflow.dsl.world`. `text`, `judge` and `published` treat a few keys
individually."""

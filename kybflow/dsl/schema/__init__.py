"""JSON Schema of the language and of the parts, generated from their declarations; the errors of
`jsonschema` in our words; the published schema for editors. Knows one file at a time: what imports
and `like` bring is judged later. Resolving and shaping call it, and `kybflow schema`.
"""

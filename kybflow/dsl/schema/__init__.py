"""JSON Schema from the parts' declarations, and `jsonschema`'s errors in our words."""

"""The document back to YAML, as `kybflow show --resolved` prints it."""

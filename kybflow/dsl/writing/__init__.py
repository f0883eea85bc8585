"""The document back to YAML, as `kybflow show --resolved` prints it. Only the compiler calls it."""

"""The resolved tree to the typed document."""

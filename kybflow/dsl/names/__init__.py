"""Names that a mission may use: built-in states, options, and what its expressions may name."""

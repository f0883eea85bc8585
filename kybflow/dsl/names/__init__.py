"""Names that a mission may use: built-in states, options, and what expressions may name."""

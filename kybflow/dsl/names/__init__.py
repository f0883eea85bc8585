"""The names that a mission may use: built-in states, options, and the names in its expressions."""

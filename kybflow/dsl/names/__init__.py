"""Names that a mission may use: built-in states, options, and what its expressions may name. Looks
names up and decides nothing about what is asked of them. Resolving, expanding, checks and
`bind` call it.
"""

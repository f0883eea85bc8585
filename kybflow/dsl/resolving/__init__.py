"""Nodes to one tree: imports, libraries, `like`, stacks, chains and parameters away. Decodes no
values but those of parameters. Only the compiler calls it, and what lists libraries.
"""

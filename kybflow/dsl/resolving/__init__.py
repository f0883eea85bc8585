"""Resolve a mission's nodes to one tree: imports, libraries, `like`, stacks, chains and parameters
are replaced by what they stand for. Only the values of parameters are decoded here. The compiler
and the listing of libraries use this folder."""

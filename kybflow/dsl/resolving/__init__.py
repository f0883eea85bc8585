"""Nodes to one tree: imports, libraries, `like`, stacks, chains, parameters and points away."""

"""Drawings of a plan's state machines: what is drawn, its layout, and its text as Mermaid and SVG.
Knows plans and no YAML.
"""

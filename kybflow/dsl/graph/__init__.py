"""Drawings of a plan's state machines: what is drawn, its layout, and its text as Mermaid and SVG.
The input is a plan, never YAML."""

"""Drawings of state machines: Mermaid and SVG."""

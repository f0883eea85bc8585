"""The resolved tree to the typed document: SI values, parts with their parameters, a span on
everything. Judges each value alone; what two of them mean together is a check. Only the compiler
calls it; checks and lowering ask it which vehicles a flow drives.
"""

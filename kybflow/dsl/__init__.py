"""The mission language: text to plan. `compiler` lists the passes; each has a folder.

Every folder imports only those above it here:

    diagnostics   what a finding is, where it stands, how it is printed and explained
    reading       text to nodes with spans, and a node to one typed value
    expressions   conditions and expectations
    plan          what a mission means, the only thing that the runtime sees
    document      what a mission says, typed, with its spans
    names         what a mission may call by name
    schema        the shape of the language, judged by JSON Schema
    resolving     imports, `like`, stacks, chains and parameters away
    shaping       the resolved tree to the document
    checks        what can be proven of the document
    lowering      the document to the plan
    writing       the document back to YAML
    graph         a plan as a drawing
    machine       a plan's state machines, run by `transitions`

Never imports the runtime or a driver: it is given a catalog of parts.
"""

"""The mission language: text to plan. `compiler` lists the passes; each has a folder.

Every folder and file imports only those above it here:

    diagnostics   what a finding is, where it stands, how it is printed and explained
    reading       text to nodes with spans, and a node to one typed value
    expressions   conditions and expectations
    language      the machinery of records: shape, schema, decoding, docs, completion, text
    world, plan   the records themselves: every key of the language, and what a mission means
    names         what a mission may call by name
    resolving     imports, `like`, stacks, chains and parameters away
    expanding     the resolved tree to the records as written, for one target
    checks        what can be proven of them before take-off
    bind          names to what they mean: the plan that the runtime sees
    graph         a plan as a drawing
    machine       a plan's state machines, run by `transitions`

The types of `language` are below the records, and what decodes, judges and writes records is above.
Never imports the runtime or a driver: it is given a catalog of parts.
"""

"""The mission language, from text to plan. `compiler` lists the passes; each has a folder.

Every folder and file imports only those above it in this list:

    diagnostics   findings: their content, source locations, printing and explanation
    reading       YAML text to nodes with spans, and a node to one typed value
    expressions   conditions and expectations
    language      the handling of records: shape check, schema, decoding, docs, completion, text
    world, plan   the records: every key of the language, and what a mission means
    names         what a mission may refer to by name
    resolving     replaces imports, `like`, stacks, chains and parameters by what they stand for
    expanding     the resolved tree to the records as written, for one target
    checks        what can be proven of the records before take-off
    bind          replaces names by what they mean; the result is the plan that the runtime sees
    graph         a plan as a drawing
    machine       a plan's state machines, run by `transitions`

In `language`, `records` and `schema` are below `world` and `plan`; the modules that decode, judge
and write records are above them. The package never imports the runtime or a driver: its functions
receive a catalog of parts.
"""

"""The command line. A command is a module of `commands/`, `printing/` makes the text of those that
print much, `arguments` and `output` are what commands share; `app` gathers them. Only
`python -m kybflow` and the console script import it.
"""

"""The command line. A command is a module of `commands/`, what it prints is made in `printing/`;
`app` gathers them. Nothing imports this but `python -m kybflow`.
"""

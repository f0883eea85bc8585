"""`python -m kybflow`: the command line."""

from kybflow.cli import main

main()

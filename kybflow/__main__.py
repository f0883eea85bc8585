"""`python -m kybflow`: the command line."""

from kybflow.cli.app import main

main()

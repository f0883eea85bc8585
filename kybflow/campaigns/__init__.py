"""`kybflow test`: flies missions as tests.

`cases` flies one case, `session` flies many in parallel processes, `coverage` finds the states and
transitions that no flight took, and `junit` writes the results for CI.
"""

"""`kybflow test`: flies missions as tests.

`cases` flies one case, computes the coverage and writes the results as JUnit XML; `session` flies
many cases in parallel processes.
"""

"""`kybflow test`: missions flown as tests. `cases` flies one, `session` many in parallel processes,
`coverage` finds what none of them took, `junit` writes the results for CI. The command line calls
it; it calls the API.
"""

"""The second mutation study: changes that a person could really make by mistake, each known to do
harm or to make no sense, and changes that are sensible. `bench/harm.py` prints it.

`mission_text` edits missions, `operator` says what a change is; each family of changes is a file,
`valid_variants` has those that nothing may be said of, `study` judges them. Nothing here looks at
how a check works; nothing in kybflow may be tuned to a single change of the half that is held out.
"""

"""What a run leaves: the recorder, as an observer of the engine, and the run folder beside it. The
runtime never imports it; `kybflow.api` puts the two together and `kybflow.report` reads what is
left.
"""

"""Writes the files of a run.

`recorder` writes the recording as an observer of the engine, `run_folder` writes the other files,
and `earlier_run` reads them to repeat a run. `kybflow.api` uses this package and `kybflow.report`
reads its files; the runtime never imports it.
"""

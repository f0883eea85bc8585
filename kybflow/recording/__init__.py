"""The files of a run: `recorder` writes the recording as an observer of the engine, `run_folder`
the other files, `earlier_run` reads them to repeat a run. `kybflow.api` uses them and
`kybflow.report` reads the result; the runtime never imports this package.
"""

"""Makes `report.html` from a run folder.

`data` reads the folder, `page` fills the templates, and the other modules make figures and tables;
`comparison` writes the page about several runs. Callers use `page.write_report` and
`comparison.write_comparison`. The report never imports the runtime, the drivers or the API.
"""

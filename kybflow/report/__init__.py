"""`report.html` from a run folder: `data` reads it back, the other modules make figures and tables
of it, `page` fills the templates. Only `page.write_report` is called from outside. The report reads
recordings: it never imports the runtime, the drivers or the API.
"""

"""Makes `report.html` from a run folder.

`data` reads the folder, `page` fills the templates, and the other modules make figures and tables.
Callers use only `page.write_report`. The report never imports the runtime, the drivers or the API.
"""

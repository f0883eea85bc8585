"""`report.html` from a run folder: reads recordings, never the runtime. `page.write_report` is its
only door.
"""

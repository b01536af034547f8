"""The report of a run as one self-contained HTML page.

Read `report.html.jinja` first, which is the page from top to bottom. `pages` passes it the values
computed by the `*_sections`.
"""

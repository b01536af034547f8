"""The report of a run as one self-contained HTML page.

Read `report.html.jinja` first: it is the page, from top to bottom. `pages` gives it the values,
which the sections (`*_sections`) compute.
"""

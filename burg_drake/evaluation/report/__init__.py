"""The report of a run as one self-contained HTML page.

Read `pages` first; the sections (`*_sections`) are put together of `page_elements` and `charts`.
"""

"""The report of a run as one self-contained HTML page.

Read `page` first, or `campaign` for many scenes; `sections` are put together of `elements`."""

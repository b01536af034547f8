"""The placement check: how far each object of a real scene stands from its target.

Read `check` first. It searches objects with `object_search` and `localization`, aligns them with
`silhouette_aligner` or `depth_aligner`, looks for `misplaced_objects` and writes a `document`.
"""

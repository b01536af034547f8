"""The placement check: how far each object of a real scene stands from its place.

Read `check` first; it goes from `search`, `candidates` and `alignment` over `localization` to
`assessment`, looks for objects that are `exchanged` and for `extras`, and ends in a `document`."""

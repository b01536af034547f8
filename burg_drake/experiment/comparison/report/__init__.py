"""The page of a comparison, in the style of the report of a run."""

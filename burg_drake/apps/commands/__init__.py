"""The commands of `burg-drake`, by topic; `apps.cli` lists them."""

"""Options that several verbs have, so that the same ones mean the same everywhere.

`arguments` comes first; each other module has the options of one matter."""

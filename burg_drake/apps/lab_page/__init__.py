"""The page of the lab: trials are entered where they are carried out."""

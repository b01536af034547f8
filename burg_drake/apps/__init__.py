"""The command line: thin verbs over the library, which hold no logic.

Begin with `cli`; each group of verbs is a package whose `verbs` add the others, and what they share
is in `options`, `terminal` and `web`.
"""

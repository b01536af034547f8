"""Scene documents: which objects stand where on the board, and whether they can.

Read `document` first; `arrangement` finds room for objects.
"""

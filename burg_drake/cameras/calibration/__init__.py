"""Intrinsics of a camera from images of a ChArUco board, and how far they can be trusted.

Read `target`, `estimation`, `lens_choice` and `lens_fit`, then `lens_uncertainty`, `promise` and
`guidance`."""

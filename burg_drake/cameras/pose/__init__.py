"""Where a camera is over the printed board, by the edges of all markers.

Read `estimator` first; it goes from `detection` over `coarse` to `refinement`, and
`camera_location` averages over images."""

"""Many trials of the hand alone at once, as parallel worlds of MuJoCo Warp.

Read `batch_trial` first, then `parallel_worlds`, which steps the worlds on the device, and
`trial_kernels`, the phases of a trial there.
"""

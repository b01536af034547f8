from .hand_sweep import (
    HandSweep as HandSweep,
    Sweep as Sweep,
)

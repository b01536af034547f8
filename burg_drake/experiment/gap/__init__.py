"""Gap between simulation and reality, step by step, and real trials judged again.

Read `gap_measurement` and `gap_steps` first, then `rejudging`."""

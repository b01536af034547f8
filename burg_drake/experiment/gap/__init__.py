"""Where simulation and reality part: real trials judged again, and one cause after the other.

Read `measurement` and `steps` first, then `rejudging`."""

"""Trials on the real robot beside simulated ones: selection, records, comparison, the gap."""

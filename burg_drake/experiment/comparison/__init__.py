"""Simulated and real outcomes held against each other."""

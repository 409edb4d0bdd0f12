"""Tuning of observers: a search for settings, tasks that state one, scores on held-out records."""

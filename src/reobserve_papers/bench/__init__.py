"""The bench: observers and filters on the same tasks, tuned by one rule."""

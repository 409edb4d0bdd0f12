"""The tasks of the bench, one module each: see `reobserve.tuning.task`."""

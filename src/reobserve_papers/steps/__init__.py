"""A paper's figures recomputed: the chain plant -> observers -> metrics -> plot in one process."""

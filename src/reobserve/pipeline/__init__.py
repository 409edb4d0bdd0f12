"""From a ledger to results: in one process, or as jobs; and where results come from."""

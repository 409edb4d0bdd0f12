"""Detection of changes and faults: tests of innovations, and thresholds by false alarms."""

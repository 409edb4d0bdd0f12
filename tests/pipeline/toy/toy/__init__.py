"""A lag with a disturbance: what adding a paper takes, every stage included."""

"""A lag with a disturbance: a minimal paper with every stage."""

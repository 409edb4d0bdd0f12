"""Map from each equation of a paper to its implementation and its test."""

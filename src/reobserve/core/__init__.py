"""What is computed with: compiled loops, matrices, sampling, random streams, pinned code paths."""

"""Models of plants, on which observers are built."""

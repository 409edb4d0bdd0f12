"""Plain data on disk: files written whole, and read as checked values."""

"""The plants, one a file."""

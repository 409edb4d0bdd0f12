"""What holds for every observer, and for every call of the library."""

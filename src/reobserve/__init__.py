"""State and fault observers from five papers."""

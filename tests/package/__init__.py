"""The package as others install it: what the wheel holds, what each extra brings, metadata."""

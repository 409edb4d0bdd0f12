"""The package as others install it: its wheel, and its extras one by one."""

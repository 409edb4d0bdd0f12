"""What the users of each extra do; scripts that need nothing of this checkout."""

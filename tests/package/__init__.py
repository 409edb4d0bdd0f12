"""The installed package: content of the wheel, extras and metadata."""

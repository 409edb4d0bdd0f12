"""What the results say: claims, golden numbers, differences of figures, the report."""

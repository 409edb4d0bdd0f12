"""What the results say: claims, equations, golden numbers, differences of figures, the report."""

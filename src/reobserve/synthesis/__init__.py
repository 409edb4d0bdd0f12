"""How gains are found and judged: stability, accuracy and the papers' theorems."""

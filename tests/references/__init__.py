"""Independent references: other formulations, closed forms, published numbers with their source."""

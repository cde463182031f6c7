"""Shape functions and quadrature of the plate's elements."""

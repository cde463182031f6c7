"""Pages on which an impact follows sliders: one file with the plate and the compiled kernel."""

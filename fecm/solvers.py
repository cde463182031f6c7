"""Choices of the time integration, alone in a module so that naming them imports nothing else."""

# By what suits the mesh, or by the sparse matrix in any case.
AUTO, CSR = "auto", "csr"
SOLVERS = (AUTO, CSR)

# Part of the critical time step that is taken where a deck gives none.
SAFE = 0.9

"""Physics broken on purpose, by subject: what is broken, how, and the rows that have to see it."""

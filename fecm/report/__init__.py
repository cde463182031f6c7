"""One HTML page about results, to hand on."""

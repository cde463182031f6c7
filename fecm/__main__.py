"""``python -m fecm``."""

from fecm.cli import main

main(prog_name="fecm")

"""Write the page of all datasets, ``docs/datasets.md``, from the schema of the files.

python docs/datasets.py docs/datasets.md
"""

from __future__ import annotations

import sys
from pathlib import Path

from fecm.results.schema import FILES, OF_QUANTITY, TEXTS, Dataset, Form, dataset_of

HEAD = """\
# Datasets

Look up the shape, the dimension and the meaning of every dataset here. `fecm info` lists the
datasets of one file:

```console
$ fecm info RESULT.h5
```

[Results](results.md) explains what the datasets mean together. Names in a shape are sizes: `rows`
is the number of rows of the group, `numnp` and `numel` count nodes and elements, `npt` and `nps`
points of an element, `ndf` degrees of freedom of a node. `NAME` stands for any name. Numbers
without a dimension are pure. A deck with [`COMP`](deck.md) stores rows of nodes and of elements
in single precision.
"""
TITLES = {Form.RUN: "Runs", Form.SWEEP: "Sweeps", Form.LOCATION: "Locations"}
TABLE = ["| dataset | shape | dimension | what it is |", "|---|---|---|---|"]


def datasets_page() -> str:
    """Text of the page in Markdown: a table for each kind of file."""
    lines = [HEAD]
    for form, file in FILES.items():
        lines += [f"## {TITLES[form]}", "", f"`/deck`: {file.deck}.", "", *TABLE]
        for path in file.datasets:
            named = path.replace("*", "NAME")
            if (dataset := dataset_of(named, len(file.datasets[path].shape), form)) is not None:
                lines.append(_row(dataset))
        lines.append("")
    return "\n".join(lines)


def _row(dataset: Dataset) -> str:
    shape = ", ".join(map(str, dataset.shape))
    if dataset.outer:
        shape = f"[{dataset.outer},] {shape}"
    dimension = "text" if dataset.dtype == TEXTS else dataset.dimension
    if dimension == OF_QUANTITY:
        dimension = "of the quantity"
    return f"| `/{dataset.path}` | {shape} | {dimension} | {dataset.description} |"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(datasets_page(), encoding="utf-8")

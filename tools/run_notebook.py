"""Run the tutorial notebook and store its outputs, without what differs from run to run.

python tools/run_notebook.py docs/notebooks/tour.ipynb
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

PICTURES = ("image/svg+xml", "image/png")


def run_notebook(path: Path, timeout_s: int = 300) -> Any:
    """Execute the cells of a notebook in its folder.

    Parameters
    ----------
    path : path
        The notebook, which is not changed.
    timeout_s : int
        Limit for each cell, seconds.

    Returns
    -------
    nbformat.NotebookNode
        The notebook with its new outputs.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        If a cell raises an error.
    """
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    NotebookClient(
        notebook,
        timeout=timeout_s,
        kernel_name="python3",
        resources={"metadata": {"path": str(path.parent)}},
        record_timing=False,
        coalesce_streams=True,
    ).execute()
    return notebook


def tidy(notebook: Any) -> None:
    """Keep of each output its picture or table with its text, and drop the metadata of the machine."""
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    for number, cell in enumerate(notebook.cells):
        cell.id = f"cell-{number}"
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            for kind in [kind for kind in PICTURES if kind in data][1:]:
                del data[kind]
            output.pop("metadata", None)
            if output.output_type != "stream":
                output.metadata = {}


def main() -> None:
    """Run and store a notebook."""
    import nbformat

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("notebook", type=Path)
    path = parser.parse_args().notebook
    notebook = run_notebook(path)
    tidy(notebook)
    nbformat.write(notebook, path)


if __name__ == "__main__":
    main()

"""The hooks of mkdocs: each notebook becomes a page."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

sys.path.insert(0, str(Path(__file__).parent))

from writing import notebooks


def on_files(files: Files, config: Any) -> Files:
    """Add a page for each notebook."""
    for path in notebooks.paths():
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=notebooks.page(path)))
    return files

"""The wheel of one platform: with HSDSL_SHIP_LOOP=1 the hand-written C loop is in it, compiled.

Without, the wheel is pure Python and for every platform; the loop is compiled where it is first used.
"""

from __future__ import annotations

import os
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class LoopHook(BuildHookInterface[Any]):
    """Compiles the loop and puts it into the wheel."""

    def dependencies(self) -> list[str]:
        """Ask for a compiler where there is none of the system's."""
        return ["ziglang>=0.11"] if sys.platform == "win32" and os.environ.get("HSDSL_SHIP_LOOP") == "1" else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the loop before the wheel is written."""
        if self.target_name != "wheel" or os.environ.get("HSDSL_SHIP_LOOP") != "1":
            return
        if sys.platform == "win32":
            os.environ["CC"] = f'"{sys.executable}" -m ziglang cc'
        sys.path.insert(0, self.root)
        from hsdsl.runtime.library import ship

        library = ship(Path(tempfile.mkdtemp()))
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{platform}"
        build_data["force_include"][str(library)] = f"hsdsl/runtime/shipped/{library.name}"

"""The hand-written C loop, compiled when the package is built or installed, so that the first run need not wait for it.

A wheel is for one platform and has the loop in it; an editable installation has it in the user's cache. Where there is
no C compiler, or with HSDSL_SHIP_LOOP=0, the wheel is pure Python, and the loop is compiled where it is first used.
With HSDSL_SHIP_LOOP=1 a wheel without the loop is an error.
"""

from __future__ import annotations

import os
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SETTING = os.environ.get("HSDSL_SHIP_LOOP", "")


class LoopHook(BuildHookInterface[Any]):
    """Compiles the loop and puts it into the wheel."""

    def dependencies(self) -> list[str]:
        """Ask for a compiler where there is none of the system's."""
        return ["ziglang>=0.11"] if sys.platform == "win32" and SETTING == "1" else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the loop before the wheel is written."""
        if self.target_name != "wheel" or SETTING == "0":
            return
        if sys.platform == "win32" and SETTING == "1":
            os.environ["CC"] = f'"{sys.executable}" -m ziglang cc'
        sys.path.insert(0, self.root)
        from hsdsl.engine.runtime.compiler import NoCompiler
        from hsdsl.engine.runtime.library import loop, ship

        try:
            if version == "editable":
                loop()
                return
            library = ship(Path(tempfile.mkdtemp()))
        except NoCompiler as error:
            if SETTING == "1":
                raise
            self.app.display_warning(f"the loop is not compiled: {error}")
            return
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{platform}"
        build_data["force_include"][str(library)] = f"hsdsl/engine/runtime/shipped/{library.name}"

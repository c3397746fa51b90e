"""The archive of a unit: description, sources and a library for this platform, the same bytes for the same model."""

from __future__ import annotations

import hashlib
import platform
import sys
import zipfile
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path

from hsdsl.base.errors import UsageError
from hsdsl.engine.runtime.compiler import FLAGS, NoCompiler, find_compiler
from hsdsl.engine.runtime.library import EFFORT, loop_object
from hsdsl.engine.runtime.process import workshop
from hsdsl.export.c import c_sources
from hsdsl.export.fmi import variables
from hsdsl.export.fmi.variables import Unit

FOLDER = Path(__file__).parent
LOOP = "hs.c"
COMPILED = ("model.c", "problem.c", "instance.c", LOOP, "variables.c", "fmu.c", "surfaces.c", "events.c", "fmi.c")
_EPOCH = (1980, 1, 1, 0, 0, 0)
_SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
_PROCESSORS = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64", "i686": "x86"}


def token_of(unit: Unit, version: int) -> str:
    """A UUID of the model, its settings, its variables and this version."""
    digest = hashlib.sha256("\n".join((str(version), unit.modes, *unit.source.heading)).encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def sources_of(unit: Unit, version: int) -> dict[str, bytes]:
    """The sources in one folder, by their names; see :func:`compiled_names` for those that are compiled."""
    flat = {Path(name).name: text for name, text in c_sources(unit.source, tunable=True).items()}
    flat["variables.h"] = variables.header(unit, token_of(unit, version)).encode()
    flat["variables.c"] = variables.numbers(unit).encode()
    flat["fmi_version.h"] = f'#include "fmi{version}.h"\n'.encode()
    names = {"fmu", "surfaces", "events", "fmi", f"fmi{version}"}
    parts = (path for path in sorted((FOLDER / "parts").glob("*.[hc]")) if path.stem in names)
    return flat | {path.name: path.read_bytes() for path in parts}


def platform_folder(version: int) -> tuple[str, str]:
    """The folder of libraries for this platform, as a version of FMI calls it, and their suffix.

    Raises UsageError: that has no name.
    """
    system, suffix = _SYSTEMS.get(sys.platform, ("", ""))
    processor = _PROCESSORS.get(platform.machine().lower(), "")
    if not system or not processor:
        raise UsageError(f"FMI has no name for this platform, {sys.platform} on {platform.machine()}")
    if version == 3:
        return f"{processor}-{system}", suffix
    bits = "64" if sys.maxsize > 2**32 else "32"
    return {"windows": "win"}.get(system, system) + bits, suffix


def library_of(sources: Mapping[str, bytes], version: int) -> bytes:
    """The sources compiled for this platform.

    Raises UsageError: there is no compiler, or it fails.
    """
    with workshop() as folder:
        for name, text in sources.items():
            (folder / name).write_bytes(text)
        target, files = folder / "unit.so", [folder / name for name in compiled_names(version) if name != LOOP]
        try:
            find_compiler().build([*files, loop_object(folder)], [folder], target, EFFORT, FLAGS)
        except NoCompiler as error:
            raise UsageError(f"a unit has a library for this platform: {error}") from None
        return target.read_bytes()


def archived(files: Mapping[str, bytes]) -> bytes:
    """A zip file of these, in this order and without times."""
    memory = BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), content, zipfile.ZIP_DEFLATED)
    return memory.getvalue()


def unit_file(unit: Unit, version: int, description: str, further: Mapping[str, bytes]) -> dict[str, bytes]:
    """The ``.fmu`` file by its name."""
    sources = sources_of(unit, version)
    folder, suffix = platform_folder(version)
    name = unit.source.name
    files = {"modelDescription.xml": description.encode()}
    files |= {f"sources/{part}": text for part, text in sorted(sources.items())} | dict(further)
    files[f"binaries/{folder}/{name}{suffix}"] = library_of(sources, version)
    return {f"{name}.fmu": archived(files)}


def compiled_names(version: int) -> Sequence[str]:
    """The files to compile."""
    return (*COMPILED, f"fmi{version}.c")

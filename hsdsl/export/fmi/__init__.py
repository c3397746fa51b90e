"""Functional mock-up units of FMI 2.0 and 3.0, for model exchange and co-simulation.

Both versions share `variables`, their C, and most of their `description`. An archive has the description, sources and a
library for this platform: the same bytes for the same model.
"""

from __future__ import annotations

import platform
import sys
import zipfile
from collections.abc import Mapping, Sequence
from functools import partial
from io import BytesIO
from pathlib import Path

from hsdsl.base.errors import UsageError
from hsdsl.engine.runtime.compiler import FLAGS, NoCompiler, find_compiler
from hsdsl.engine.runtime.library import EFFORT, loop_object
from hsdsl.engine.runtime.process import workshop
from hsdsl.export import Modes
from hsdsl.export.c import c_sources
from hsdsl.export.fmi import description as xml
from hsdsl.export.fmi import variables
from hsdsl.export.fmi.variables import Unit, unit_of
from hsdsl.export.source import Source

FOLDER = Path(__file__).parent
LOOP = "hs.c"
COMPILED = ("model.c", "problem.c", "instance.c", LOOP, "variables.c", "fmu.c", "surfaces.c", "events.c", "fmi.c")
_EPOCH = (1980, 1, 1, 0, 0, 0)
_SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
_PROCESSORS = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64", "i686": "x86"}
_CAN2 = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True, "providesDirectionalDerivative": True}
_CAN3 = {
    **{"canGetAndSetFMUState": True, "canSerializeFMUState": True},
    **{"providesDirectionalDerivatives": True, "providesAdjointDerivatives": True},
}


def _files(version: int, source: Source, modes: Modes = "local") -> dict[str, bytes]:
    """One ``.fmu`` file; ``modes`` says what the numbers of modes are to the caller.

    Raises UsageError: the C runtime has no such scheme, or there is no compiler.
    """
    unit = unit_of(source, modes)
    if version == 2:
        return unit_file(unit, 2, description2(unit), {})
    return unit_file(unit, 3, description3(unit), {"sources/buildDescription.xml": build_description(unit).encode()})


files2, files3 = partial(_files, 2), partial(_files, 3)


def description2(unit: Unit) -> str:
    """The text of ``modelDescription.xml`` of FMI 2.0."""
    listed = [(i, variable) for i, variable in enumerate(unit.variables) if variable.kind != "indicator"]
    units = {i: None if v.kind == "time" else xml.unit_of_measure(unit, v) for i, v in listed}
    root = xml.root_of(unit, 2, numberOfEventIndicators=str(len(unit.references("indicator"))))
    for tag, further in (
        ("ModelExchange", {"completedIntegratorStepNotNeeded": True}),
        ("CoSimulation", {"canHandleVariableCommunicationStepSize": True}),
    ):
        kind = xml.element(root, tag, modelIdentifier=unit.source.name, **further, **_CAN2)
        files = xml.element(kind, "SourceFiles")
        for file in compiled_names(2):
            xml.element(files, "File", name=file)
    xml.define_units(root, units.values())
    xml.define_experiment(root, unit, ("logStatusError",))
    variables = xml.element(root, "ModelVariables")
    for reference, variable in listed:
        scalar = xml.element(variables, "ScalarVariable", **xml.named(unit, variable, reference))
        if variable.kind == "mode":
            xml.element(scalar, "Integer")
        else:
            xml.element(scalar, "Real", unit=units[reference], **xml.numbers(unit, variable, 1))
    lists = {
        "Outputs": (xml.outputs(unit), "Unknown"),
        "Derivatives": (unit.references("derivative"), "Unknown"),
        "InitialUnknowns": (xml.initial_unknowns(unit), "Unknown"),
    }
    xml.structure(root, unit, lists, "index", 1)
    return xml.written(root)


def build_description(unit: Unit) -> str:
    """The text of ``buildDescription.xml``."""
    root = xml.element(None, "fmiBuildDescription", fmiVersion="3.0")
    build = xml.element(root, "BuildConfiguration", modelIdentifier=unit.source.name)
    names = xml.element(build, "SourceFileSet", language="C99", compiler="gcc", compilerOptions="-ffp-contract=off")
    for name in compiled_names(3):
        xml.element(names, "SourceFile", name=name)
    return xml.written(root)


def description3(unit: Unit) -> str:
    """The text of ``modelDescription.xml`` of FMI 3.0."""
    name, root = unit.source.name, xml.root_of(unit, 3)
    xml.element(root, "ModelExchange", modelIdentifier=name, needsCompletedIntegratorStep=False, **_CAN3)
    steps = {"canHandleVariableCommunicationStepSize": True, "hasEventMode": True}
    xml.element(root, "CoSimulation", modelIdentifier=name, **steps, **_CAN3)
    xml.define_units(root, [xml.unit_of_measure(unit, variable) for variable in unit.variables])
    xml.define_experiment(root, unit, ("logStatusError", "logEvents"))
    variables = xml.element(root, "ModelVariables")
    for reference, variable in enumerate(unit.variables):
        known = xml.named(unit, variable, reference)
        if variable.kind == "mode":
            xml.element(variables, "Int32", **known)
        else:
            known |= {"unit": xml.unit_of_measure(unit, variable)} | xml.numbers(unit, variable, 0)
            xml.element(variables, "Float64", **known)
    lists = {
        "Output": xml.outputs(unit),
        "ContinuousStateDerivative": unit.references("derivative"),
        "InitialUnknown": xml.initial_unknowns(unit),
        "EventIndicator": unit.references("indicator"),
    }
    xml.structure(root, unit, {tag: (unknowns, tag) for tag, unknowns in lists.items()}, "valueReference", 0)
    return xml.written(root)


def sources_of(unit: Unit, version: int) -> dict[str, bytes]:
    """The sources in one folder, by their names; see :func:`compiled_names` for those that are compiled."""
    flat = {Path(name).name: text for name, text in c_sources(unit.source, tunable=True).items()}
    flat["variables.h"] = variables.header(unit, xml.token_of(unit, version)).encode()
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

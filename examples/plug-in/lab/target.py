"""An export target: the graph of modes for Graphviz."""

from hsdsl.export.source import Source


def files(source: Source) -> dict[str, bytes]:
    """Write one file, with a node for each mode and an arrow for each transition."""
    names = [mode.name for mode in source.problem.program.modes]
    lines = [f"// {line}" for line in source.heading] + ["digraph {"]
    lines += [f'  "{name}";' for name in names]
    for mode in source.problem.program.modes:
        lines += [f'  "{mode.name}" -> "{names[edge.target]}" [label="{edge.name}"];' for edge in mode.edges]
    return {f"{source.name}.dot": "\n".join([*lines, "}", ""]).encode()}

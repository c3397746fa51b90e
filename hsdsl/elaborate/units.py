"""Units: kept as they are written, for names that exist."""

from __future__ import annotations

from hsdsl.elaborate.symbols import SymbolTable
from hsdsl.names import did_you_mean, shown
from hsdsl.schema import ParameterEntry


def elaborate_units(symbols: SymbolTable) -> dict[str, str]:
    """The unit of each name that has one."""
    known = [name for name, kind in symbols.names.items() if kind != "let"] + [*symbols.all_outputs, "t"]
    found: dict[str, str] = {}
    for key, scalar in symbols.document.units.items():
        if key not in known:
            message = f"'{shown(key)}' is neither a state nor a parameter, an input or an output"
            symbols.resolver.add(key.place, "HS313", message, did_you_mean(key, known))
        unit = symbols.text(scalar)
        if unit is not None:
            found[str(key)] = unit
    for key, entry in symbols.document.parameters.items():
        unit = symbols.text(entry.unit) if isinstance(entry, ParameterEntry) else None
        if unit is None:
            continue
        if found.setdefault(str(key), unit) != unit:
            message = f"the parameter '{key}' has the unit '{shown(unit)}' here and '{shown(found[key])}' in `units`"
            symbols.resolver.add(key.place, "HS316", message, "keep one of them")
    return found

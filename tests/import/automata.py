"""Texts of SpaceEx models, put together from parts."""

from __future__ import annotations

from html import escape


def param(name: str, **attributes: str) -> str:
    given = {"type": "real", "d1": "1", "d2": "1", "local": "false", "dynamics": "any", **attributes}
    return f'<param name="{name}" ' + " ".join(f'{k}="{v}"' for k, v in given.items()) + "/>"


def location(key: int, invariant: str, flow: str, name: str = "") -> str:
    name = name or f"l{key}"
    inner = f"<invariant>{escape(invariant)}</invariant><flow>{escape(flow)}</flow>"
    return f'<location id="{key}" name="{name}">{inner}</location>'


def transition(source: int, target: int, guard: str = "", assignment: str = "", label: str = "") -> str:
    parts = {"label": label, "guard": guard, "assignment": assignment}
    inner = "".join(f"<{tag}>{escape(text)}</{tag}>" for tag, text in parts.items() if text)
    return f'<transition source="{source}" target="{target}">{inner}</transition>'


def component(name: str, *parts: str) -> str:
    return f'<component id="{name}">\n' + "\n".join(parts) + "\n</component>"


def model(*components: str) -> str:
    return (
        '<?xml version="1.0"?>\n<sspaceex math="SpaceEx" version="0.2">\n' + "\n".join(components) + "\n</sspaceex>\n"
    )

"""The lint rules by code: name, check and severity of each; their pages are the Markdown files here, one a family.

Other packages may add rules, with codes of their own that do not begin with HS; each brings its page.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Literal, NamedTuple

from hsdsl.analysis.lint.finding import Finding
from hsdsl.analysis.lint.rules import experiment, guards, regularity, shape, units
from hsdsl.analysis.lint.subject import Subject
from hsdsl.base.plugins import Table

PLUG_INS = "plug-ins"
FAMILIES = {
    "names": ("HS400", "HS419"),
    "shape": ("HS420", "HS459"),
    "experiment": ("HS460", "HS479"),
    "comments": ("HS490", "HS499"),
    "mathematics": ("HS500", "HS599"),
    "units": ("HS600", "HS699"),
}
Check = Callable[[Subject], Iterable[Finding]]


class Rule(NamedTuple):
    """A rule: its name, its check, and the severity of its findings.

    A warning is a probable mistake. A note is a remark: notes alone leave the exit code at 0. Rules about comments
    have no check, because they see what the others find. The page of a rule of another package is Markdown, and its
    first line says what the rule finds.
    """

    name: str
    check: Check | None = None
    severity: Literal["warning", "note"] = "warning"
    page: str = ""


def family(code: str) -> str:
    """The family that a code belongs to."""
    return next((name for name, (first, last) in FAMILIES.items() if first <= code <= last), PLUG_INS)


def _fault(code: str, rule: Any) -> str | None:
    if not isinstance(rule, Rule) or rule.check is None or not rule.page.strip():
        return f"'{code}': expected a Rule with a check and a page, got {type(rule).__name__}"
    if not re.fullmatch(r"(?!HS)[A-Z]{2,8}\d{3,4}", code):
        return f"expected a code such as LAB001, of letters other than HS and a number, got '{code}'"
    return None


_OWN: dict[str, Rule | str] = {
    "HS401": Rule("unused-parameter", partial(shape.unused_name, kind="parameter")),
    "HS402": Rule("unused-input", partial(shape.unused_name, kind="input")),
    "HS403": Rule("unused-let", shape.unused_let),
    "HS404": Rule("unused-state", shape.unused_state),
    "HS405": Rule("shadowed-name", shape.shadowed_name, "note"),
    "HS406": Rule("unreachable-mode", shape.unreachable_mode),
    "HS409": Rule("misnamed-output", shape.misnamed_output),
    "HS410": Rule("unused-function", partial(shape.unused_name, kind="function")),
    "HS421": Rule("identity-reset", shape.identity_reset),
    "HS422": Rule("missing-reset", shape.missing_reset),
    "HS425": Rule("dead-end", shape.dead_end),
    "HS426": Rule("duplicate-transition", shape.duplicate_transition),
    "HS427": Rule("shadowed-transition", shape.shadowed_transition),
    "HS428": Rule("constant-condition", shape.constant_condition),
    "HS429": Rule("empty-section", shape.empty_section, "note"),
    "HS447": Rule("after-the-end", shape.after_the_end),
    "HS461": Rule("starts-outside", experiment.starts_outside),
    "HS462": Rule("starts-on-guard", experiment.starts_on_guard, "note"),
    "HS463": Rule("ends-on-event", experiment.ends_on_event, "note"),
    "HS464": Rule("large-relaxation", experiment.large_relaxation),
    "HS490": Rule("unused-ignore"),
    "HS491": Rule("unknown-ignore"),
    "HS492": Rule("undecided", severity="note"),
    "HS501": Rule("guard-never-crossed", guards.guard_never_crossed),
    "HS502": Rule("condition-beyond-surface", guards.condition_beyond_surface),
    "HS503": Rule("guard-inside-domain", guards.guard_inside_domain, "note"),
    "HS504": Rule("guard-turns-inward", guards.guard_turns_inward, "note"),
    "HS505": Rule("tangency", regularity.tangency, "note"),
    "HS506": Rule("reset-lands-beyond", guards.reset_lands_beyond),
    "HS507": Rule("reset-lands-on-guard", guards.reset_lands_on_guard, "note"),
    "HS508": Rule("overlapping-guards", guards.overlapping_guards),
    "HS509": Rule("sliding", guards.sliding),
    "HS510": Rule("zero-time-cycle", guards.zero_time_cycle),
    "HS511": Rule("jump-inside-mode", regularity.jump_inside_mode),
    "HS512": Rule("kink-inside-mode", regularity.kink_inside_mode, "note"),
    "HS513": Rule("vanishing-divisor", regularity.vanishing_divisor),
    "HS514": Rule("outside-real-domain", regularity.outside_real_domain),
    "HS515": Rule("not-lipschitz", regularity.not_lipschitz),
    "HS517": Rule("degenerate-surface", regularity.degenerate_surface),
    "HS601": Rule("unknown-unit", units.unknown_unit),
    "HS602": Rule("inconsistent-units", partial(units.misfits, kind="sum", hint=units.CONVERT)),
    "HS603": Rule("argument-units", partial(units.misfits, kind="argument", hint=units.PLAIN)),
    "HS604": Rule("flow-units", partial(units.differing, roles=units.FLOWS)),
    "HS605": Rule("value-units", partial(units.differing, roles=units.VALUES)),
}
RULES = Table[Rule]("rules", _OWN, _fault)

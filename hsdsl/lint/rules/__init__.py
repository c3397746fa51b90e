"""The lint rules: one file each, whose docstring is the rule's page, in one dictionary."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import ModuleType
from typing import Literal

from hsdsl.lint.finding import Finding
from hsdsl.lint.rules import (
    adding_delays,
    after_the_end,
    argument_units,
    condition_beyond_surface,
    confusable_names,
    constant_condition,
    constant_state,
    dead_end,
    degenerate_surface,
    duplicate_transition,
    empty_section,
    ends_on_event,
    flow_units,
    guard_inside_domain,
    guard_never_crossed,
    guard_turns_inward,
    identity_reset,
    idle_parameter,
    idle_priority,
    idle_state,
    inconsistent_units,
    invented_state,
    jump_inside_mode,
    kink_inside_mode,
    large_relaxation,
    late_reference,
    lost_state,
    misleading_name,
    misnamed_output,
    missing_reset,
    not_lipschitz,
    odd_samples,
    odd_step,
    outside_real_domain,
    overlapping_guards,
    repeated_default,
    repeated_wall,
    reset_lands_beyond,
    reset_lands_on_guard,
    shadowed_name,
    shadowed_transition,
    sliding,
    starts_on_guard,
    starts_outside,
    tangency,
    twin_modes,
    unbounded_domain,
    undecided,
    uneven_relaxation,
    unknown_ignore,
    unknown_unit,
    unreachable_mode,
    unused_ignore,
    unused_input,
    unused_let,
    unused_parameter,
    unused_state,
    value_units,
    vanishing_divisor,
    zero_time_cycle,
)
from hsdsl.lint.subject import Subject

FAMILIES = {
    "names": ("HS400", "HS419"),
    "shape": ("HS420", "HS439"),
    "scene": ("HS440", "HS459"),
    "experiment": ("HS460", "HS479"),
    "comments": ("HS490", "HS499"),
    "mathematics": ("HS500", "HS599"),
    "units": ("HS600", "HS699"),
}


@dataclass(frozen=True)
class Rule:
    """A rule: its module, and how much its findings weigh.

    A warning says that something is probably not what was meant; a note, that something is worth knowing:
    notes alone leave the exit code at 0.
    """

    module: ModuleType
    severity: Literal["warning", "note"] = "warning"
    by_default: bool = True  # False: only where it is selected, by its code, its name or its family

    @property
    def name(self) -> str:
        """What people call it."""
        return self.module.__name__.rpartition(".")[2].replace("_", "-")

    @property
    def page(self) -> str:
        """The rule's page, in Markdown; its first line is the title."""
        return (self.module.__doc__ or "").strip()

    @property
    def title(self) -> str:
        """What the rule finds, in one line."""
        return self.page.partition("\n")[0].rstrip(".")

    @property
    def check(self) -> Callable[[Subject], Iterable[Finding]] | None:
        """The rule itself; None for the rules about comments, which see what the others have found."""
        return getattr(self.module, "check", None)


def family(code: str) -> str:
    """The family that a code belongs to."""
    return next(name for name, (first, last) in FAMILIES.items() if first <= code <= last)


RULES: dict[str, Rule] = {
    # names
    "HS401": Rule(unused_parameter),
    "HS402": Rule(unused_input),
    "HS403": Rule(unused_let),
    "HS404": Rule(unused_state),
    "HS405": Rule(shadowed_name, severity="note"),
    "HS406": Rule(unreachable_mode),
    "HS407": Rule(confusable_names),
    "HS408": Rule(misleading_name),
    "HS409": Rule(misnamed_output),
    # shape
    "HS421": Rule(identity_reset),
    "HS422": Rule(missing_reset),
    "HS423": Rule(lost_state),
    "HS424": Rule(invented_state),
    "HS425": Rule(dead_end),
    "HS426": Rule(duplicate_transition),
    "HS427": Rule(shadowed_transition),
    "HS428": Rule(constant_condition),
    "HS429": Rule(empty_section, severity="note"),
    "HS430": Rule(idle_priority),
    # scene
    "HS441": Rule(idle_state, severity="note"),
    "HS442": Rule(idle_parameter, severity="note"),
    "HS443": Rule(twin_modes),
    "HS444": Rule(constant_state, severity="note"),
    "HS445": Rule(repeated_default, severity="note"),
    "HS446": Rule(repeated_wall),
    "HS447": Rule(after_the_end),
    # experiment
    "HS461": Rule(starts_outside),
    "HS462": Rule(starts_on_guard, severity="note"),
    "HS463": Rule(ends_on_event, severity="note"),
    "HS464": Rule(large_relaxation),
    "HS465": Rule(uneven_relaxation),
    "HS466": Rule(odd_samples),
    "HS467": Rule(odd_step),
    "HS468": Rule(late_reference),
    "HS469": Rule(adding_delays, severity="note"),
    # comments
    "HS490": Rule(unused_ignore),
    "HS491": Rule(unknown_ignore),
    "HS492": Rule(undecided, severity="note"),
    # mathematics
    "HS501": Rule(guard_never_crossed),
    "HS502": Rule(condition_beyond_surface),
    "HS503": Rule(guard_inside_domain, severity="note"),
    "HS504": Rule(guard_turns_inward, severity="note"),
    "HS505": Rule(tangency, severity="note"),
    "HS506": Rule(reset_lands_beyond),
    "HS507": Rule(reset_lands_on_guard, severity="note"),
    "HS508": Rule(overlapping_guards),
    "HS509": Rule(sliding),
    "HS510": Rule(zero_time_cycle),
    "HS511": Rule(jump_inside_mode),
    "HS512": Rule(kink_inside_mode, severity="note"),
    "HS513": Rule(vanishing_divisor),
    "HS514": Rule(outside_real_domain),
    "HS515": Rule(not_lipschitz),
    "HS516": Rule(unbounded_domain, severity="note", by_default=False),
    "HS517": Rule(degenerate_surface),
    # units
    "HS601": Rule(unknown_unit),
    "HS602": Rule(inconsistent_units),
    "HS603": Rule(argument_units),
    "HS604": Rule(flow_units),
    "HS605": Rule(value_units),
}

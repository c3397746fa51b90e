"""The page of the gallery, from the records and the models."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import groupby
from textwrap import fill

from gallery.records import Record, Records
from gallery.scenes import Entry
from gallery.settings import MOST, WITHIN
from hsdsl.base.defaults import SCHEMES
from hsdsl.interface.chart import PEERS

OURS = ("hsdsl c", "hsdsl python")
OUTCOMES = ("right", "warns", "stops", "refuses", "wrong", "crashes", "hangs")  # from best to worst
filled = partial(fill, width=120, break_long_words=False, break_on_hyphens=False)
HEAD = """<!-- Written by examples/gallery: edit the models and the code, not this page. -->

# Where methods fail

This page has {count} small scenes. Each shows one phenomenon and has an exact solution. One command runs all of them
with every scheme, method and engine of hsdsl, and with the other tools that you have installed:

<!-- not run: takes an hour; tests/golden/test_gallery.py runs every scene -->
```console
$ python examples/gallery
```

The command compares each run with the exact execution. It writes this page, its pictures and `gallery.json`. You find
the models in `models/gallery/*.yaml` and the exact executions next to them. `models/references` computes these in
eighty digits, without the simulator.

## Who is right

Each cell counts outcomes. The cells of hsdsl count all its methods, step sizes and engines; those of other tools count
the tolerances 1e-6 and 1e-9.

| word | meaning |
| --- | --- |
| right | the exact execution: transitions, modes, and states within {state:.0%} of their span, {time:.1%} of the run |
| warns | another execution, and the verdict says `left` or `unknown` |
| stops | the run ends before the end, with a reason |
| refuses | the tool or its translation does not take the model, with a reason |
| **wrong** | another execution, without a word |
| **hangs** | no result within 30 seconds of the processor, or 8 in `stiff-switch` |
| **crashes** | the process dies |

{table}

{versions}

Other tools run as their documentation shows (`hsdsl/interface/chart/peers`); each restarts its events after a
transition. Some have options that help in some scenes. `casadi` and `diffrax` do not take every model. hsdsl runs
methods of every order, also explicit ones on stiff scenes, with tolerances of 1e-6 and 1e-9. Fixed steps are a
thousandth and a ten-thousandth of the run, and `--estimate` checks them. A run has at most {most:,} transitions. The
Python engine agrees with the compiled one to the last bit. It runs `paoli-schatzman`, and three methods in some scenes.
A dash means that a tool has not been run.

## Which event other tools see

`findings/events-of-peers.sh` installs these versions and shows each behaviour on x' = 1:

- diffrax 0.7.2: if a step crosses two guards, the first in the list ends it, not the earlier one. This decides no row:
  where diffrax is wrong here, no other guard was crossed before the one that ended an arc.
- CasADi 3.8.2: an event occurs where `zero` falls through zero, but not if `zero` is zero at the start. This decides
  [event-at-start](#event-at-start): with the ball 1e-12 higher, CasADi is right there.
- CasADi 3.8.2: `rk` loses an event on an output time. This decides no row: the table has `rosenbrock`, which does not.
- heyoka 7.13.2: an event with a direction passes a triple root, where the derivative is zero. This decides no row: the
  guards here have simple and double roots.
- scikit-SUNDAE 1.2.0: a solver keeps counting the events of earlier calls. This decides no row: each call here ends at
  its first event.

"""


def page(records: Records, entries: Sequence[Entry]) -> str:
    """The whole page as Markdown."""
    tools = ", ".join(f"{name} {number or '(not installed)'}" for name, number in records.versions.items())
    head = HEAD.format(
        count=len(entries),
        state=WITHIN.state,
        time=WITHIN.time,
        table=_table(records, entries),
        versions=filled(f"Versions: {tools}."),
        most=MOST,
    )
    return head + "\n".join(_section(records, entry) for entry in entries)


def _table(records: Records, entries: Sequence[Entry]) -> str:
    peers = [name for name in PEERS if records.versions.get(name)]
    lines = [f"| scene | {' | '.join((*SCHEMES, *peers))} |", "| --- |" + " --- |" * (len(SCHEMES) + len(peers))]
    for entry in entries:
        ours = [[r for tool in OURS for r in records.of(entry.name, tool, scheme)] for scheme in SCHEMES]
        cells = [_counted(found) for found in (*ours, *(records.of(entry.name, name) for name in peers))]
        lines.append(f"| [{entry.name}](#{entry.name}) | {' | '.join(cells)} |")
    return "\n".join(lines)


def _counted(found: Sequence[Record]) -> str:
    count = Counter(record.outcome.word for record in found)
    if len(count) == 1:
        return _shown(next(iter(count)))
    return ", ".join(f"{count[word]} {_shown(word)}" for word in OUTCOMES if count[word]) or "-"


def _shown(word: str) -> str:
    return f"**{word}**" if word in ("wrong", "hangs", "crashes") else word


def _section(records: Records, entry: Entry) -> str:
    what, exact, hard = entry.words
    title = entry.model.system.title
    lines = [
        f"## {entry.name}",
        "",
        f"![{title}](images/gallery/{entry.name}.svg)",
        "",
        filled(f"**{title}**: {what}"),
        "",
        filled(f"Exact: {exact}"),
        "",
        filled(f"Why methods fail: {hard}"),
        "",
        *(filled(line, subsequent_indent="  ") for line in _others(records, entry)),
    ]
    return "\n".join(lines) + "\n"


def _others(records: Records, entry: Entry) -> Iterator[str]:
    """Every outcome that is not right, those with the same word and reason together."""
    found = [r for r in records.rows if r.scene == entry.name and r.outcome.word != "right"]
    ours = [r for r in found if r.setting.name in OURS]
    theirs = [r for r in found if r.setting.name not in OURS]
    for (scheme, word), group in groupby(sorted(ours, key=_kind), key=_kind):
        members = list(group)
        methods = ", ".join(dict.fromkeys(f"`{r.setting.method}`" for r in members if r.setting.method))
        why = Counter(r.outcome.why for r in members).most_common(1)[0][0]
        yield f"- {scheme}{f' with {methods}' if methods else ''}: {_shown(word)} ({_plain(why)})"
    for tool, group in groupby(theirs, key=lambda r: r.setting.name):
        reasons: dict[tuple[str, str], list[str]] = {}
        for r in group:
            reasons.setdefault((r.outcome.word, r.outcome.why), []).append(f"{r.setting.tolerance:.0e}")
        for (word, why), sizes in reasons.items():
            yield f"- {tool} at {' and '.join(sizes)}: {_shown(word)} ({_plain(why)})"


def _kind(record: Record) -> tuple[str, str]:
    return record.setting.scheme, record.outcome.word


def _plain(text: str) -> str:
    """A reason inside a line of Markdown."""
    line = " ".join(text.split())
    return "".join(f"\\{c}" if c in "*_<>[]`|" else c for c in line)

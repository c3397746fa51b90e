# pyright: basic
"""Motion along guards that hold a state, at rest where that is none, and Zeno tails that end in it."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax

from .control import NOTHING
from .functions import chosen, frozen, keeping, when, with_derivatives_of
from .lane import (
    BOUNDARY,
    END,
    FREE,
    STEP,
    TOUCH,
    ZENO,
    contraction,
    flown,
    last_flights,
    noticed,
    of_contacts,
    releasing,
    sampled,
    scaled,
    sizes_here,
    stopped,
)
from .model import HELD, LOOKED_AT, Bound, noise_of
from .steps import at
from .surfaces import UNIT, after_reset, keeps, ties

ZERO_UNITS, FURTHER = 16, 16
MOST_ROUNDS, MOST_CORRECTIONS_TO_GUARD, MOST_LEAP, LAST_TIES = 60, 4, 4096, 4
PARALLEL = 1e-6


def takes_back(slope, back):
    """Whether one direction is opposite to another that is not zero, in each component."""
    first = jnp.argmax(slope != 0)
    share = jnp.where(slope[first] == 0, 0.0, back[first] / jnp.where(slope[first] == 0, 1.0, slope[first]))
    off = jnp.abs(back - share * slope)
    return (share < 0) & (off <= PARALLEL * jnp.abs(share) * jnp.abs(slope)).all()


def levels(model, lane, held, looked=False):
    """Numbers of contacts, of the edges ``held`` of a mode, and of those ``looked`` at."""
    place = model.of(model.contact, model.of(model.owner, lane.mode))
    place = jnp.where(place >= 0, place, model.C)
    numbers = jnp.where(held, HELD, jnp.where(looked, LOOKED_AT, 0.0))
    return jnp.zeros(model.C).at[place].max(numbers, mode="drop")


def in_touch(model, lane):
    """The edges of a mode whose guards hold the state."""
    place = model.of(model.contact, model.of(model.owner, lane.mode))
    return (place >= 0) & (jnp.append(lane.contacts, 0.0)[place] == HELD)


def flow_along(model, bound, lane, held, t, x):
    """The flow along the guards of some edges, the mode's own where there are none."""
    owner = model.of(model.owner, lane.mode)
    mode = jnp.where(held.any(), model.of(model.held, owner), owner)
    return bound.touching(levels(model, lane, held)).flow(mode, t, x)


def is_possible(model, bound, lane, k, t, x, touched=False):
    """Whether the `if` of edge k holds at a point, or next along the flow that the guards of other edges leave."""
    owner, next_to = model.of(model.owner, lane.mode), pressed(model, bound, lane, k, t, x, touched)
    both = bound.facts(owner, jnp.stack([t, t]), jnp.stack([x, next_to]))
    return both.conditions[:, k].any()


def may_hold_next(model, bound, lane, returning, times, states):
    """Which of some edges that lead back, on whose surfaces the state is, have an `if` that holds next."""
    returning = returning & model.of(model.loops, lane.mode)

    def look():
        each = jnp.arange(model.M), times, states
        return jax.vmap(lambda k, t, x: is_possible(model, bound, lane, k, t, x))(*each)

    return returning & when(returning.any(), look, returning)


def pressed(model, bound, lane, k, t, x, touched=False):
    """Where the flow presses a state, by what the guard of edge k takes away of the flow that others' guards leave."""
    owner, own = model.of(model.owner, lane.mode), jnp.arange(model.M) == k
    others = touched & ~own
    slope = flow_along(model, bound, lane, others, t, x)
    left = flow_along(model, bound, lane, others | own, t, x)
    slope = jnp.where(model.of(model.contact, owner)[k] >= 0, slope - left, slope)
    moved = model.of(model.changes, model.of(model.edge, owner)[k]) & (slope != 0)
    sizes = sizes_here(model, lane)
    after = jnp.where(moved, ZERO_UNITS * UNIT * sizes / jnp.abs(jnp.where(slope == 0, 1.0, slope)), 0.0).max()
    return x + jnp.where(after > 0, after, UNIT * model.until) * slope  # the latter for states that were zero only


def kept_by(model, bound, lane, surfaces, t, x):
    """The edges of some surfaces whose guards hold the state where the flow presses on them: resets keep it there."""
    facts = bound.facts(lane.mode, t, x)
    rows = jax.jacfwd(lambda x: bound.flow(lane.mode, t, x))(x)
    sizes = jnp.abs(bound.flow(lane.mode, t, x)) + jnp.abs(rows) @ sizes_here(model, lane)
    size = jnp.abs(facts.gradients[:, 0]) + jnp.abs(facts.gradients[:, 1:]) @ sizes
    tangent = jnp.abs(facts.rates) <= ZERO_UNITS * UNIT * size
    may = surfaces & (model.of(model.contact, lane.mode) >= 0)
    still = jax.vmap(lambda k: keeps(model, bound, lane, k, t, x))(jnp.arange(model.M))
    return may & still & ((model.of(model.order, lane.mode) == 1) | tangent)


def looked(model, bound, lane, held, others):
    """The routines, mode and lane that look at the pushes on guards while those ``held`` hold the state."""
    contacts = levels(model, lane, held, others)
    mode = model.of(model.held, model.of(model.owner, lane.mode)).astype(jnp.int32)
    return bound.touching(contacts), lane._replace(mode=mode, contacts=contacts)


def pushes(model, bound, lane, holding, kept, t, x):
    """Those of some guards that the flow presses on while those ``holding`` hold it; whether it has a value there."""
    there, held = looked(model, bound, lane, holding, kept)
    facts = there.facts(held.mode, t, x)
    r, noise = facts.values, noise_of(facts, t, x, scaled(model, held))
    falls = lifts_next(model, there, held, kept, t, x)
    without, at_none = looked(model, bound, lane, jnp.zeros_like(kept), kept)
    holds = without.facts(at_none.mode, t, x).conditions
    holds |= jax.vmap(lambda k: is_possible(model, bound, lane, k, t, x, holding))(jnp.arange(model.M))
    return kept & holds & ((r < -noise) | ((r <= noise) & ~falls)), ~(jnp.isnan(r) & kept).any()


def lifts_next(model, bound, held, kept, t, x):
    """Whether the push on a guard, zero now, is first negative where the flow makes it differ from zero."""

    def further(state):
        t, x, after, open_, lifts = state
        time = held.t + after
        x = x + (time - t) * bound.flow(held.mode, t, x)
        facts = bound.facts(held.mode, time, x)
        differs = open_ & (jnp.abs(facts.values) > noise_of(facts, time, x, scaled(model, held)))
        return time, x, after * FURTHER, open_ & ~differs, lifts | (differs & (facts.values > 0))

    state = t, x, jnp.asarray(UNIT * model.until), kept, jnp.zeros_like(kept)
    return lax.while_loop(lambda s: s[3].any() & (held.t + s[2] < bound.end), further, state)[4]


def pressing(model, bound, lane, kept, t, x):
    """Those of some guards that hold the state together, and whether that is one choice."""

    def again(state):
        _, holding, _, turn = state
        found, has = pushes(model, bound, lane, holding, kept, t, x)
        return holding, found, has, turn + 1

    def goes_on(state):
        before, holding, has, turn = state
        return has & (before != holding).any() & (turn < kept.sum() + 2) & ((turn == 0) | (kept.sum() > 1))

    before, holding, has, _ = lax.while_loop(goes_on, again, (~kept, kept, kept.any(), jnp.zeros((), int)))
    return holding & has, ~kept.any() | (has & ((before == holding).all() | (kept.sum() == 1)))


def into_contact(model, p, lane, mask):
    """Let the guards that a state is on hold it, where they do; stop where they have no one motion."""
    still = frozen(lane)
    bound = Bound(model, frozen(p), still.segment)
    may = still.active & (model.of(model.contact, lane.mode) >= 0)

    def look():
        t, x = still.t, still.x
        holding, one = pressing(model, bound, still, kept_by(model, bound, still, may, t, x), t, x)
        flows = ~jnp.isnan(flow_along(model, bound, still, holding, t, x)).any()
        return holding, one & (flows | (holding.sum() < 2))

    holding, one = when(mask & may.any(), look, (jnp.zeros_like(may), jnp.asarray(True)))
    return lane_along(model, bound, lane, holding, one, mask)


def lane_along(model, bound, lane, holding, one, mask):
    """A run that goes on along the guards of edges ``holding``, in its mode itself where there are none."""
    known = model.of(model.of_owner, jnp.maximum(model.of(model.held, lane.mode), 0))
    along = lane._replace(
        mode=model.of(model.held, lane.mode).astype(jnp.int32), contacts=levels(model, lane, holding),
        active=(known >= 0) & (lane.active & ~holding)[known], emerging=jnp.zeros_like(lane.emerging),
    )  # fmt: skip
    after = jnp.where(lane.t < bound.end, STEP, jnp.where(bound.last, END, BOUNDARY)).astype(jnp.int32)
    found = chosen(holding.any(), along, lane)._replace(phase=after, began=frozen(lane.t))
    return chosen(mask, stopped(found, ~one, ZENO), lane)


def out_of_contact(model, bound, lane, t, x, reached):
    """A run in its mode itself again, on the guards that held it, and without what steps along them were off by.

    It stays on those that it has ``reached``.
    """
    owner, touched = model.of(model.owner, lane.mode).astype(jnp.int32), in_touch(model, lane)
    places = model.of(model.of_held, owner)
    active = ((places >= 0) & (lane.active & ~releasing(model, lane))[places]) | touched
    free = lane._replace(
        mode=owner, contacts=jnp.zeros_like(lane.contacts), active=active, emerging=jnp.zeros_like(lane.emerging)
    )
    still, time, point = frozen(free), frozen(t), frozen(x)

    def look():
        q = in_turn(lambda k, x: onto_guard(model, bound, still, k, time, x), touched | reached, point)
        q = in_turn(lambda k, x: fixed_point(model, bound, still, k, time, x), touched, q)
        same = jax.vmap(lambda k: keeps(model, bound, still, k, time, q))(jnp.arange(model.M))
        return jnp.where((same | ~touched).all(), q, point)

    return free, keeping(when(touched.any(), look, point), x)


def let_go(model, config, p, lane, event):
    """Leave guards that hold a state at an event, or where a segment of inputs ends; return other events."""
    bound, still = Bound(model, frozen(p), lane.segment, lane.contacts), frozen(lane)
    touched, ends = in_touch(model, still), event.mask & releasing(model, still)[event.k]
    leaves = touched.any() & (event.mask | (lane.phase == BOUNDARY))
    t, x = jnp.where(event.mask, event.t, lane.t), jnp.where(event.mask, event.x, lane.x)
    own = event.k < model.of(model.is_edge, model.of(model.owner, lane.mode)).sum()
    late, frees = past_end(model, config, bound, still, event.k, frozen(t), frozen(x), ends & ~own)
    point = x + late * bound.flow(still.mode, frozen(t), frozen(x))
    facts, moved = bound.facts(still.mode, frozen(t) + late, frozen(point)), frozen(t) + late
    on = still.active & (jnp.abs(facts.values) <= noise_of(facts, moved, frozen(point), scaled(model, still)))
    later = lane._replace(active=jnp.where(ends, on, lane.active))
    reached = (jnp.arange(model.M) == event.k) & event.mask & ~ends
    free, q = out_of_contact(model, Bound(model, frozen(p), lane.segment), later, t + late, point, reached)
    nothing = ends & own & (still.began == frozen(t))  # to round-off it neither holds the state nor lets go
    free = free._replace(active=free.active & ~(nothing & (jnp.arange(model.M) == event.k)))
    begins = {"clear": jnp.asarray(False), "halvings": jnp.zeros_like(lane.halvings), "trial": lane.h,
              "terms": jnp.zeros_like(lane.terms)}  # fmt: skip
    on_again = later._replace(t=t + late, x=point, phase=jnp.int32(STEP), **begins)
    free_again = free._replace(
        t=t + late, x=q, phase=jnp.int32(TOUCH), scale=event.sizes, entered_x=frozen(q), **begins
    )
    at_boundary = free._replace(x=q)
    after = chosen(ends, chosen(frees | own, free_again, on_again), at_boundary)
    after = noticed(model, chosen(leaves & (ends | ~event.mask), after, lane), frozen(lane.x))
    goes = event.mask & ~ends
    return after, event._replace(mask=goes, x=jnp.where(goes & leaves, q, event.x), held=touched)


def past_end(model, config, bound, lane, k, t, x, needed):
    """How far beyond the end of a part of an `if` a point is, at which surface k is above round-off; whether one ends.

    The ends of other parts of it may not be reached yet.
    """
    touched, most = in_touch(model, lane), UNIT**0.5 * config.until  # further on a line is no motion
    place = model.of(model.releases, lane.mode)[k]
    own = jnp.argmax(touched & (model.of(model.contact, model.of(model.owner, lane.mode)) == place))
    slope, left = bound.flow(lane.mode, t, x), bound.end - t

    def further(state):
        after, _, _, _ = state
        s = jnp.minimum(after, left)
        time, point = t + s, x + s * slope
        may = jax.vmap(lambda j: is_possible(model, bound, lane, j, time, point, touched))(jnp.arange(model.M))
        ended = (touched & ~may).any()
        ahead = bound.facts(lane.mode, time, pressed(model, bound, lane, own, time, point, touched))
        facts = bound.facts(lane.mode, time, point)
        above = ahead.values[k] > noise_of(facts, time, point, scaled(model, lane))[k]
        return after * 2, s, ended, ~ended & ~above & (after < most) & (s < left)

    state = jnp.asarray(UNIT * config.until), jnp.zeros(()), jnp.asarray(False), needed
    _, s, ended, _ = lax.while_loop(lambda s: s[3], further, state)
    return s, ended


def limit(step, x, several=True):
    """The point that repeated steps run to: by Aitken's acceleration of each state, if the step after it is shorter.

    Each turn of the loop makes one step, of three; all but the first only where ``several``.
    """

    def again(state):
        x, one, two, leap, turn, _ = state
        part, new = turn % 3, step(jnp.where(turn % 3 == 0, x, jnp.where(turn % 3 == 1, one, leap)))
        shorter = (jnp.abs(new - leap) <= jnp.abs(two - one)).all()
        later = jnp.where(shorter, new, two)
        later = jnp.where(part == 2, jnp.where(jnp.abs(later) > NOTHING, later, 0.0), x)
        goes = several & ((part != 0) | (new != x).any())
        one, two = jnp.where(part == 0, new, one), jnp.where(part == 1, new, two)
        return jnp.where(several, later, new), one, two, jnp.where(part == 1, leapt(x, one, two), leap), turn + 1, goes

    state = x, x, x, x, jnp.zeros((), int), jnp.asarray(True)
    return lax.while_loop(lambda s: s[5] & (s[4] < 3 * MOST_ROUNDS), again, state)[0]


def leapt(x, one, two):
    """Where acceleration leads from three points."""
    bend = two - 2 * one + x
    slow = (bend != 0) & (jnp.abs(two - one) <= jnp.abs(one - x)) & (jnp.abs(two - one) <= MOST_LEAP * jnp.abs(bend))
    return jnp.where(slow, x - (one - x) / jnp.where(bend == 0, 1.0, bend) * (one - x), two)


def one_after_another(taken, mask, x):
    """What edges, one after another, take a state to."""
    return lax.fori_loop(0, len(mask), lambda k, x: jnp.where(mask[k], taken(k, x), x), x)


def in_turn(taken, mask, x):
    """The point that a state runs to which several edges, in turn, take to what one of them keeps."""
    return limit(lambda x: one_after_another(taken, mask, x), x, mask.sum() > 1)


def fixed_point(model, bound, lane, k, t, x):
    """The point that repeated resets run to."""
    return limit(lambda x: after_reset(model, bound, lane, k, t, x), x)


def onto_guard(model, bound, lane, k, t, x):
    """A point near a guard taken to it, as near as numbers are, each state in proportion to its scale."""
    scales = sizes_here(model, lane)

    def correct(state):
        x, r, turn, _ = state
        gradient = bound.facts(lane.mode, t, x).gradients[k, 1:]
        weights = gradient * scales * scales
        across = gradient @ weights
        nearer = x - r / jnp.where(across > 0, across, 1.0) * weights
        left = bound.surfaces(lane.mode, t, nearer)[k]
        goes = (across > 0) & (jnp.abs(left) < jnp.abs(r))
        return jnp.where(goes, nearer, x), jnp.where(goes, left, r), turn + 1, goes

    state = x, bound.surfaces(lane.mode, t, x)[k], jnp.zeros((), int), jnp.asarray(True)
    return lax.while_loop(lambda s: s[3] & (s[2] < MOST_CORRECTIONS_TO_GUARD), correct, state)[0]


def limit_of(model, config, bound, lane, touched, edges, end):
    """The point that a tail runs to: kept by resets, moved along the guards to its end, and kept by resets there."""
    first = jnp.argmax(edges)
    along = model.of(model.contact, lane.mode)[first] >= 0

    def kept(t, x):
        return in_turn(lambda k, x: fixed_point(model, bound, lane, k, t, x), edges, x)

    q, h = kept(lane.t, lane.x), end - lane.t
    slope = flow_along(model, bound, lane, touched | edges, lane.t, q)
    turned = flow_along(model, bound, lane, touched | edges, end, q + h * slope)
    moved = in_turn(lambda k, x: onto_guard(model, bound, lane, k, end, x), edges, q + h * (slope + turned) / 2)
    q = kept(end, jnp.where(along, moved, q))
    facts = bound.facts(lane.mode, end, q)
    on = (jnp.abs(facts.values) <= noise_of(facts, end, q, lane.scale)) | ~edges
    return q, on.all() & (~along | is_near(model, config, bound, lane, edges))


def is_near(model, config, bound, lane, edges):
    """Whether what edges take back, each of its guard or of the rate of that, is no more than pushes make in a while.

    The while is the relaxation: so near is the limit.
    """
    there, held = looked(model, bound, lane, jnp.zeros_like(edges), edges)
    sizes, facts = there.facts(held.mode, lane.t, lane.x).magnitudes, bound.facts(lane.mode, lane.t, lane.x)
    last = jnp.where(model.of(model.order, lane.mode) == 1, facts.values, facts.rates)
    return ((jnp.abs(last) <= config.relaxation * sizes) | ~edges).all()


def meets_another(bound, lane, t, x, edges):
    """Whether a surface other than those of edges is passed on the way to a limit."""
    facts, first = bound.facts(lane.mode, t, x), bound.facts(lane.mode, lane.t, lane.x)
    before = noise_of(first, lane.t, lane.x, jnp.where(lane.active[:, None], lane.scale, 0.0))
    after = noise_of(facts, t, x, jnp.where(lane.active[:, None], lane.scale, 0.0))
    return ((facts.values > after) & ~(first.values > before) & ~edges).any()


def nearly_over(model, config, lane):
    """Whether a tail ends within the relaxation, its edges, and a bound on its remaining time."""
    shrinks, flight, ratio = contraction(model, lane)
    k = (model.of(model.edge, lane.mode) == lane.edges[-1]) & model.of(model.is_edge, lane.mode)
    left = flight * ratio / (1 - jnp.where(ratio < 1, ratio, 0.0))
    own, edges = of_contacts(model, lane)
    late = flown(lane, lane.t)
    several = own & (edges.sum() > 1) & (lane.count >= FREE) & (late <= config.relaxation)
    found = jnp.where(shrinks, left <= config.relaxation, several)
    return found, jnp.where(shrinks, k, edges), jnp.where(shrinks, left, late)


def unresolved(model, config, lane):
    """Whether a tail of the last edge without a limit is shorter than time can tell; of an event, before that.

    It might not be armed again there. The relaxed scheme goes on with all others.
    """
    k = (model.of(model.edge, lane.mode) == lane.edges[-1]) & model.of(model.is_edge, lane.mode)
    tails, tie = jnp.asarray(model.tails)[lane.edges[-1]], ties(lane.t)
    if config.scheme == "relaxed":
        enough, flights = last_flights(model, lane, True)
        return k.any() & (tails == 2) & enough & (flights.max() <= tie)
    shrinks, flight, ratio = contraction(model, lane)
    follows = (k & (model.of(model.contact, lane.mode) >= 0)).any()
    ends = ~follows & shrinks & (flight * ratio <= tie * (1 - ratio))
    shrinks, flight, ratio = contraction(model, lane, True)
    of_event = (tails == 2) & (lane.t == lane.resumed) & shrinks & (flight * ratio <= LAST_TIES * tie)
    return k.any() & (tails > 0) & (ends | of_event)


def kept_next(model, p, lane, edges, t, x):
    """Where repeated resets lead, for its derivatives."""
    bound = Bound(model, p, lane.segment)

    def leap(step, x):
        return leapt(x, step(x), step(step(x)))

    def kept(k, x):
        return leap(lambda x: after_reset(model, bound, lane, k, t, x), x)

    return leap(lambda x: one_after_another(kept, edges, x), x)


def close_tail(model, config, p, lane, record, touched, mask):
    """Go to the limit of a tail that is nearly over; stop at one where no motion along the guard goes on."""
    bound, still = Bound(model, frozen(p), lane.segment), frozen(lane)
    found, edges, left = nearly_over(model, config, still)
    found = found & (jnp.asarray(model.tails)[still.edges[-1]] > 0)
    end = jnp.minimum(still.t + left, bound.end)
    instant = (edges.sum() > 1) & (end == still.t)
    k = jnp.argmax((model.of(model.edge, lane.mode) == still.edges[-1]) & model.of(model.is_edge, lane.mode))
    near = mask & found & model.of(model.loops, lane.mode)[k] & ((end > still.t) | instant) & ~(touched | ~edges).all()

    def look():
        def nearer(state):
            end, *_, turn = state
            q, on = limit_of(model, config, bound, still, touched, edges, end)
            again = on & meets_another(bound, still, end, q, edges) & (turn == 0)
            return jnp.where(again, still.t, end), q, on, again, turn + 1

        state = end, still.x, jnp.asarray(False), jnp.asarray(True), jnp.zeros((), int)
        time, q, on, *_ = lax.while_loop(lambda s: s[3], nearer, state)
        same = jax.vmap(lambda k: keeps(model, bound, still, k, time, q))(jnp.arange(model.M))
        on = on & (same | ~edges).all()
        none = on & (model.of(model.contact, lane.mode)[k] < 0) & is_possible(model, bound, still, k, time, q, touched)
        goes = on & (model.of(model.contact, lane.mode)[k] >= 0)
        goes = goes & (kept_by(model, bound, still, edges, time, q) == edges).all()
        kept = kept_by(model, bound, still, touched | edges, time, q)
        presses = (pressing(model, bound, still, kept, time, q)[0] & edges).any()
        goes = goes & (instant | presses) & ~meets_another(bound, still, time, q, edges)
        return time, q, none, goes

    end, limit_at, none, goes = when(near, look, (end, still.x, jnp.asarray(False), jnp.asarray(False)))

    end = keeping(end, lane.t)
    q = with_derivatives_of(lambda *given: kept_next(model, *given))(limit_at, (p, still, edges, end, lane.x))
    length = jnp.where(goes & (end > still.t), frozen(end) - still.t, 1.0)
    record = sampled(
        record, config, goes, lane.mode, lane.t, end,
        lambda times: jax.vmap(lambda time: at(lane.x, (q - lane.x)[None], (time - lane.t) / length))(times),
    )  # fmt: skip
    facts = bound.facts(lane.mode, frozen(end), limit_at)
    r, noise = facts.values, noise_of(facts, frozen(end), limit_at, still.scale)
    rest = noticed(model, lane, limit_at)._replace(
        t=end, x=q, active=(jnp.abs(r) <= noise) | edges, emerging=jnp.zeros_like(lane.emerging), entered_x=limit_at,
        phase=jnp.int32(TOUCH), terms=jnp.zeros_like(lane.terms),
    )  # fmt: skip
    return chosen(goes, rest, stopped(lane, none, ZENO)), record, goes | none

//! A run under way: entering a mode, choosing among crossings, resets.

use crate::kernel::{bound, Edge, Mode, Settings, Sink, State, Stop, StopReason, Transition};
use crate::math::{finite, max, min, root, size};
use crate::model::{D, E, JACOBIAN, JACOBIAN_PLACES, M, MODES, P, SEGMENTS, STAGES, STATES, W};
use crate::table::Piece;

pub const UNIT: f64 = 1.0 / 9007199254740992.0;
const TIE: f64 = 1e-12;

/// Where a step crossed a guard: share of the step, time and state there, and the depth reached.
#[derive(Clone, Copy)]
pub struct Crossing {
    pub edge: usize,
    pub theta: f64,
    pub time: f64,
    pub state: State,
    pub depth: f64,
}

impl Crossing {
    pub const NONE: Crossing = Crossing { edge: 0, theta: 0.0, time: 0.0, state: [0.0; W], depth: 0.0 };
}

/// One step as tried, from (t, x) to (t1, z); `ends` says whether the flow has a value there, once it was `looked` at.
pub(crate) struct Trial {
    pub t: f64,
    pub h: f64,
    pub t1: f64,
    pub looked: bool,
    pub ends: bool,
    pub piece: Option<Piece>,
}

/// What decides the length of the next step.
pub(crate) struct Control {
    pub h: f64,
    pub least: f64,
    pub accepted: u32,
    pub rejected: u32,
    pub stretch: f64,
    pub failed_at: f64,
    pub closer: bool,
}

/// A state that transitions without flow between them led to, and how many followed: room 0 for none.
#[derive(Clone, Copy)]
pub(crate) struct Chain {
    pub mode: usize,
    pub x: State,
    pub length: u64,
    pub room: u64,
}

impl Chain {
    pub const NEW: Chain = Chain { mode: 0, x: [0.0; W], length: 0, room: 0 };

    /// Count a state, after some flow or none; whether the same chain has been there before (Brent's algorithm).
    pub fn returns(&mut self, flowed: bool, mode: usize, x: &State, n: usize) -> bool {
        if !flowed && self.room > 0 {
            if mode == self.mode && x[..n] == self.x[..n] {
                return true;
            }
            self.length += 1;
            if self.length != self.room {
                return false;
            }
        }
        let room = if flowed || self.room == 0 { 1 } else { 2 * self.room };
        *self = Chain { mode, x: *x, length: 0, room };
        false
    }
}

/// Everything of a run; its memory is all here.
pub struct Run<'a, S> {
    pub(crate) sink: &'a mut S,
    pub(crate) parameters: [f64; P],
    pub(crate) settings: Settings,
    pub(crate) mode: usize,
    pub(crate) dimension: usize,
    pub(crate) segment: usize,
    pub(crate) p: [f64; P + D],
    pub(crate) t: f64,
    pub(crate) resumed: f64,
    pub(crate) x: State,
    pub(crate) slope: State,
    pub(crate) z: State,
    pub(crate) end: State,
    pub(crate) scale: State,
    pub(crate) entered: State,
    pub(crate) scales: [f64; STATES],
    pub(crate) stages: [State; STAGES],
    pub(crate) active: [bool; M],
    pub(crate) emerging: [bool; M],
    pub(crate) noise: [f64; M],
    pub(crate) trial: Trial,
    pub(crate) control: Control,
    pub(crate) reached: f64,
    pub(crate) idle: u32,
    pub(crate) creeping: u32,
    pub(crate) chatter: i32,
    pub(crate) cascade: Chain,
    pub(crate) made: usize,
}

/// Run from a mode and state at t = 0 to an end; `scales` are sizes of the states of all modes, 0 where none is known.
pub fn simulate<S: Sink>(
    parameters: &[f64; P],
    settings: &Settings,
    mode: usize,
    x: &State,
    scales: &[f64; STATES],
    sink: &mut S,
) -> Stop {
    let least = max(settings.tolerance, crate::math::root(UNIT)) * settings.largest;
    let control = Control {
        h: settings.step,
        least,
        accepted: 0,
        rejected: 0,
        stretch: 0.0,
        failed_at: f64::NAN,
        closer: false,
    };
    let mut run = Run {
        sink,
        parameters: *parameters,
        settings: *settings,
        mode,
        dimension: MODES[mode].dimension,
        segment: 0,
        p: [0.0; P + D],
        t: 0.0,
        resumed: 0.0,
        x: *x,
        slope: [0.0; W],
        z: [0.0; W],
        end: [0.0; W],
        scale: [0.0; W],
        entered: *x,
        scales: *scales,
        stages: [[0.0; W]; STAGES],
        active: [false; M],
        emerging: [false; M],
        noise: [0.0; M],
        trial: Trial { t: 0.0, h: 0.0, t1: 0.0, looked: false, ends: false, piece: None },
        control,
        reached: f64::NAN,
        idle: 0,
        creeping: 0,
        chatter: 0,
        cascade: Chain::NEW,
        made: 0,
    };
    run.scale = run.start_sizes();
    run.relaxed()
}

/// The segment that time is in; at a boundary the later one.
fn segment_at(t: f64) -> usize {
    SEGMENTS.iter().rposition(|segment| segment.start <= t).unwrap_or(0)
}

impl<S> Run<'_, S> {
    pub(crate) fn here(&self) -> &'static Mode {
        &MODES[self.mode]
    }

    pub(crate) fn flow(&self, t: f64, x: &State, out: &mut State) -> bool {
        (self.here().flow)(&self.p, t, x, out)
    }

    pub(crate) fn values(&self, t: f64, x: &State, out: &mut [f64; M]) -> bool {
        (self.here().values)(&self.p, t, x, out)
    }

    pub(crate) fn tie(&self, t: f64) -> f64 {
        TIE * size(t)
    }

    pub(crate) fn stop(&self, reason: StopReason, time: f64) -> Stop {
        Stop { reason, time, mode: self.mode, state: self.x }
    }

    /// Scale of state i of the mode.
    pub(crate) fn scale_of(&self, i: usize) -> f64 {
        self.scales[self.here().states[i]]
    }

    pub(crate) fn limit_reached(&self) -> bool {
        self.made >= self.settings.max_transitions
    }

    /// Choose which of several crossings goes, and mark the edges tied with it.
    /// The earliest goes; of tied ones, and of those whose guard its point is on, the highest priority, then the first.
    pub(crate) fn choose(&self, crossings: &[Crossing]) -> (Crossing, [bool; E]) {
        let mut first = 0;
        for i in 1..crossings.len() {
            if crossings[i].time < crossings[first].time {
                first = i;
            }
        }
        let mut chosen = crossings[first];
        let since = self.tie(chosen.time);
        let mut tied = self.standing(chosen.time, &chosen.state, since);
        let mut depth = [chosen.depth; E];
        for crossing in crossings {
            if crossing.time - chosen.time <= since {
                tied[crossing.edge] = true;
                depth[crossing.edge] = crossing.depth;
            }
        }
        let mut edge = chosen.edge;
        for k in 0..self.here().edges.len() {
            if tied[k] && self.goes_before(k, edge) {
                edge = k;
            }
        }
        chosen.edge = edge;
        chosen.depth = depth[edge];
        tied[edge] = false;
        (chosen, tied)
    }

    pub(crate) fn goes_before(&self, a: usize, b: usize) -> bool {
        let (p, q) = (self.here().edges[a].priority, self.here().edges[b].priority);
        if p == q {
            a < b
        } else {
            p > q
        }
    }

    /// Whether an edge leads back to the state's mode and its states.
    pub(crate) fn returns(&self, edge: &Edge) -> bool {
        let own = self.here().dimension;
        edge.target == self.mode && edge.dimension == own && self.dimension == own
    }

    /// Whether a second execution of an event would wait behind a transition.
    pub(crate) fn crowds(&self, crossing: &Crossing, after: &State) -> bool {
        let begins = |&q: &usize| crossing.state[q] >= 1.0 && after[q] > crossing.state[q];
        self.returns(&self.here().edges[crossing.edge]) && self.here().queues.iter().any(begins)
    }

    /// The sizes that the flow gives the states within the run, in a mode with motion along guards; else zero.
    fn start_sizes(&self) -> State {
        self.flow_sizes().filter(|found| found[..self.dimension].iter().all(|v| finite(*v))).unwrap_or([0.0; W])
    }

    fn flow_sizes(&self) -> Option<State> {
        let (n, x, until) = (self.dimension, &self.x, self.settings.until);
        let (jacobian, p) = (JACOBIAN?, bound(&self.parameters, &SEGMENTS[segment_at(0.0)]));
        let (mut slope, mut entries, mut rows) = ([0.0; W], [0.0; W * W], [[0.0; W]; W]);
        if (self.here().flow)(&p, 0.0, x, &mut slope) || jacobian(&p, 0.0, x, &mut entries) {
            return None;
        }
        for (&place, d) in JACOBIAN_PLACES.iter().zip(entries) {
            rows[place / n][place % n] = size(d);
        }
        let mut back: f64 = 0.0;
        for i in 0..n {
            back = max(back, (0..n).fold(0.0, |sum, k| sum + rows[i][k] * rows[k][i]));
        }
        let time = until / (1.0 + until * root(back)); // in which motion turns back
        let (mut first, mut found) = ([0.0; W], [0.0; W]);
        for s in 0..n {
            first[s] = max(size(x[s]), time * size(slope[s]));
        }
        for i in 0..n {
            found[i] = max(first[i], time * (0..n).fold(0.0, |sum, k| sum + rows[i][k] * first[k]));
        }
        Some(found)
    }

    /// The state behind a transition and the sizes of the numbers it came from; none where it has no finite value.
    pub(crate) fn reset(&self, crossing: &Crossing, sizes: &State) -> Option<(State, State)> {
        let edge = &self.here().edges[crossing.edge];
        let (n, to) = (self.dimension, edge.dimension);
        let (mut after, mut spread) = ([0.0; W], [0.0; W]);
        if (edge.reset)(&self.p, crossing.time, &crossing.state, &mut after) || !after[..to].iter().all(|v| finite(*v)) {
            return None;
        }
        let mut both = [0.0; 2 * W];
        both[..n].copy_from_slice(&crossing.state[..n]);
        both[n..2 * n].copy_from_slice(&sizes[..n]);
        let bad = (edge.spread)(&self.p, crossing.time, &both, &mut spread);
        if bad || !spread[..to].iter().all(|v| finite(*v)) {
            for i in 0..to {
                spread[i] = size(after[i]);
            }
        } else if self.returns(edge) {
            for &s in edge.changes {
                // resets that lose energy add round-off up, they do not magnify it
                spread[s] = min(spread[s], (self.made as f64 + 1.0) * max(size(after[s]), self.scale_of(s)));
            }
        }
        Some((after, spread))
    }
}

impl<S: Sink> Run<'_, S> {
    /// Enter a mode at (t, x): bind its routines to the segment of this time.
    pub(crate) fn place(&mut self, mode: usize, dimension: usize, t: f64) {
        self.mode = mode;
        self.dimension = dimension;
        self.segment = segment_at(t);
        self.p = bound(&self.parameters, &SEGMENTS[self.segment]);
        self.t = t;
        self.active = [false; M];
        self.emerging = [false; M];
        let x = self.x;
        self.append(t, &x);
        self.entered = x;
    }

    /// Write a row; the scales grow to the state's size.
    pub(crate) fn append(&mut self, t: f64, x: &State) {
        for (i, &place) in self.here().states.iter().enumerate().take(self.dimension) {
            self.scales[place] = max(self.scales[place], size(x[i]));
        }
        self.sink.row(t, self.mode, x, 0.0);
    }

    pub(crate) fn record(&mut self, crossing: &Crossing, tied: [bool; E], resumed: f64, after: &State, entry: bool) {
        self.made += 1;
        self.sink.transition(&Transition {
            time: crossing.time,
            resumed,
            mode: self.mode,
            edge: crossing.edge,
            entry,
            before: crossing.state,
            after: *after,
            tied,
        });
    }
}

//! What generated code and the loop know of each other, and what a run gives.

use crate::model::{D, E, P, W};

/// A routine called with the numbers it is bound to, time, states (of spreads and terms their sizes too) and results.
/// It returns whether it has no value.
pub type Routine = fn(&[f64], f64, &[f64], &mut [f64]) -> bool;
pub type State = [f64; W];

pub struct Edge {
    pub name: &'static str,
    pub target: usize,
    /// How many states it is entered with.
    pub dimension: usize,
    pub conditional: bool,
    pub priority: i32,
    pub condition: &'static [Routine],
    pub reset: Routine,
    pub spread: Routine,
    /// States that the reset changes.
    pub changes: &'static [usize],
    /// The number of the motion along its guard.
    pub contact: Option<usize>,
}

pub struct Mode {
    pub name: &'static str,
    pub dimension: usize,
    pub edges: &'static [Edge],
    /// Those of the edges, then the walls.
    pub surfaces: usize,
    pub is_final: bool,
    pub flow: Routine,
    pub values: Routine,
    pub magnitudes: Routine,
    pub outputs: Routine,
    pub gradients: &'static [Routine],
    pub rates: &'static [Routine],
    /// The sizes of the terms of a flow that jumps.
    pub terms: Option<Routine>,
    /// The flow with motions along guards.
    pub held: Option<Routine>,
    /// For each state its number among those of all modes.
    pub states: &'static [usize],
    /// States with the number of executions of an event that wait.
    pub queues: &'static [usize],
}

/// One row of a table without its zeros: stages and their weights.
pub type Row = &'static [(usize, f64)];

#[derive(PartialEq)]
pub enum Interpolant {
    Secant,
    Hermite,
    Dense,
}

/// An explicit method. Stage number `stages` is the flow at the step's end; those behind it serve the interpolant.
pub struct Method {
    pub stages: usize,
    pub extra: usize,
    pub order: i32,
    pub interpolant: Interpolant,
    pub nodes: &'static [f64],
    pub a: &'static [Row],
    pub b: Row,
    pub error: Row,
    pub coarse: Row,
    pub dense: &'static [Row],
}

/// A part of time in which inputs are lines and switches numbers.
pub struct Segment {
    pub start: f64,
    pub end: f64,
    /// Whether an input jumps at its start.
    pub jump: bool,
    pub data: [f64; D],
}

/// `tolerance` is 0 for a fixed step; `step` of an adaptive method is the first one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    pub step: f64,
    pub tolerance: f64,
    pub largest: f64,
    pub relaxation: f64,
    pub until: f64,
    pub max_transitions: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StopReason {
    Until,
    Final,
    LeftDomain,
    Zeno,
    TransitionLimit,
    /// A second execution of an event begins to wait: there is room for one.
    WaitingLimit,
    NotFinite,
    StepUnderflow,
}

/// How a run ended, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    pub reason: StopReason,
    pub time: f64,
    pub mode: usize,
    pub state: State,
}

/// A transition: when its guard was reached and when flow went on (not-a-number where the run ended first).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    pub time: f64,
    pub resumed: f64,
    pub mode: usize,
    pub edge: usize,
    /// Whether it fired on entry.
    pub entry: bool,
    pub before: State,
    pub after: State,
    /// Edges that were tied with it.
    pub tied: [bool; E],
}

/// Takes what a run gives while it goes on. States behind those of the mode have no meaning.
pub trait Sink {
    /// A row: the end of a step, or a point of a strip at this depth.
    fn row(&mut self, _time: f64, _mode: usize, _state: &State, _depth: f64) {}
    fn transition(&mut self, _made: &Transition) {}
}

impl Sink for () {}

/// Parameters of a run and the numbers of a segment, as routines are bound to them.
pub(crate) fn bound(parameters: &[f64; P], segment: &Segment) -> [f64; P + D] {
    let mut numbers = [0.0; P + D];
    numbers[..P].copy_from_slice(parameters);
    numbers[P..].copy_from_slice(&segment.data);
    numbers
}

//! A hybrid system and the loop of `hsdsl run`, in C, that runs it: no standard library; memory is the caller's.
//!
//! `model` is generated from a model; the other modules are the same for every model.

#![cfg_attr(not(test), no_std)]

mod ffi;
pub mod model;
mod names;
mod samples;

use core::fmt;
use model::{E, FIXED_UNTIL, MODES, OUTPUTS, P, SETTINGS, STATES, W};
pub use ffi::{follow, initial, parameters, MEMORY};
pub use names::{has_state, mode_name, Edge, Mode, ModeName, Part};
pub use samples::{Sample, Samples};

/// Values of states; those after the states of a mode have no meaning.
pub type State = [f64; W];

/// `tolerance` is 0 for a fixed step; `step` of an adaptive method is the first one.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    pub step: f64,
    pub tolerance: f64,
    pub largest: f64,
    pub relaxation: f64,
    pub until: f64,
    pub max_transitions: u64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StopReason {
    Until,
    Final,
    LeftDomain,
    Zeno,
    TransitionLimit,
    /// More executions of an event were to wait than may, or than there is memory for.
    WaitingLimit,
    NotFinite,
    StepUnderflow,
    /// One chain of transitions at an instant entered more modes than there is memory for.
    Interrupted,
}

impl StopReason {
    const ALL: [(StopReason, &'static str); 9] = [
        (StopReason::Until, "until"),
        (StopReason::Final, "final"),
        (StopReason::LeftDomain, "left_domain"),
        (StopReason::Zeno, "zeno"),
        (StopReason::TransitionLimit, "transition_limit"),
        (StopReason::WaitingLimit, "waiting_limit"),
        (StopReason::NotFinite, "not_finite"),
        (StopReason::StepUnderflow, "step_underflow"),
        (StopReason::Interrupted, "interrupted"),
    ];

    /// The word that hsdsl has for it.
    pub fn word(self) -> &'static str {
        StopReason::ALL[self as usize].1
    }
}

/// How a run ended, and where: `states` are the names of the first values of `state`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    pub reason: StopReason,
    pub time: f64,
    pub mode: usize,
    pub states: &'static [&'static str],
    pub state: State,
    pub outputs: [f64; OUTPUTS],
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
    /// Where it leads, also one whose run ended before it was made.
    pub after: State,
    /// Edges that were tied with it.
    pub tied: [Option<usize>; E],
}

/// A row: the start of an arc, the end of a step, or a point of a strip at its depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<'a> {
    pub time: f64,
    /// How many transitions were made before.
    pub jump: u64,
    pub mode: usize,
    /// Whether the state waits, at `depth` beyond a guard.
    pub strip: bool,
    pub depth: f64,
    pub state: &'a [f64],
    pub outputs: &'a [f64],
    /// From the row before to this one: x + u (c_1 + u (c_2 + ...)), W numbers for each c; a line where it is empty.
    piece: &'a [f64],
}

/// Takes what a run gives while it goes on.
pub trait Sink {
    fn row(&mut self, _row: &Row) {}
    fn transition(&mut self, _made: &Transition) {}
}

impl Sink for () {}

impl<A: Sink, B: Sink> Sink for (A, B) {
    fn row(&mut self, row: &Row) {
        self.0.row(row);
        self.1.row(row);
    }

    fn transition(&mut self, made: &Transition) {
        self.0.transition(made);
        self.1.transition(made);
    }
}

/// What keeps a run from its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refused {
    /// The parameter of this number is not finite.
    Parameter(usize),
    /// The initial value of this number is not finite.
    Initial(usize),
    /// There is no mode of this number.
    Mode(usize),
    /// The setting of this name has a value that it cannot have.
    Setting(&'static str),
    /// Fewer than `MEMORY` words are given.
    Memory(usize),
}

impl fmt::Display for Refused {
    fn fmt(&self, to: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Refused::Parameter(i) => write!(to, "expected a number for the parameter {}", model::PARAMETERS[*i]),
            Refused::Initial(i) => write!(to, "expected a number for initial value {}", i),
            Refused::Mode(mode) => write!(to, "expected one of {} modes, got {}", MODES.len(), mode),
            Refused::Setting("until") if FIXED_UNTIL => {
                write!(to, "expected until from 0 to {:?}, as far as inputs and switches are known", SETTINGS.until)
            }
            Refused::Setting(name) => write!(to, "the setting {} has a value that it cannot have", name),
            Refused::Memory(words) => write!(to, "expected {} words of memory, got {}", MEMORY, words),
        }
    }
}

fn check(parameters: &[f64; P], settings: &Settings, mode: usize, x: &State, words: usize) -> Result<(), Refused> {
    let positive = |value: f64| value > 0.0 && value.is_finite();
    let until = settings.until >= 0.0 && settings.until.is_finite();
    let tolerance = settings.tolerance.is_finite() && (settings.tolerance > 0.0) == (SETTINGS.tolerance > 0.0);
    let kept = [
        ("step", positive(settings.step) || settings.until == 0.0),
        ("tolerance", tolerance),
        ("largest", settings.largest >= settings.step && settings.largest.is_finite()),
        ("relaxation", positive(settings.relaxation)),
        ("until", until && !(FIXED_UNTIL && settings.until > SETTINGS.until)),
    ];
    let names = MODES.get(mode).ok_or(Refused::Mode(mode))?.states;
    let initial = if mode == model::START { model::INITIAL_STATES } else { names };
    if let Some(i) = parameters.iter().position(|value| !value.is_finite()) {
        Err(Refused::Parameter(i))
    } else if let Some(i) = x[..initial.len()].iter().position(|value| !value.is_finite()) {
        Err(Refused::Initial(i))
    } else if let Some((name, _)) = kept.iter().find(|(_, fits)| !fits) {
        Err(Refused::Setting(name))
    } else if words < MEMORY {
        Err(Refused::Memory(words))
    } else {
        Ok(())
    }
}

/// Run from a mode and state at t = 0 to an end; `scales` are sizes of the states of all modes, 0 where none is known.
///
/// `memory` has `MEMORY` words at least, with any values. A sink that panics aborts the program.
pub fn simulate<S: Sink>(
    parameters: &[f64; P],
    settings: &Settings,
    mode: usize,
    x: &State,
    scales: &[f64; STATES],
    memory: &mut [u64],
    sink: &mut S,
) -> Result<Stop, Refused> {
    check(parameters, settings, mode, x, memory.len())?;
    Ok(ffi::run(parameters, settings, mode, x, scales, memory, sink))
}

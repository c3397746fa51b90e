//! Names of modes, and of what a system of parts has at a state.

use crate::model::{MODES, OWNERS, PARTS};
use core::fmt;

pub struct Edge {
    pub name: &'static str,
    pub target: usize,
    /// The states that it leads to.
    pub states: &'static [&'static str],
}

pub struct Mode {
    pub name: &'static str,
    pub states: &'static [&'static str],
    pub edges: &'static [Edge],
}

/// A part of a system, the names of its modes, and the state that is the number of its mode, from 1 on.
pub struct Part {
    pub name: &'static str,
    pub modes: &'static [&'static str],
    pub number: Option<usize>,
}

impl Part {
    /// The index of the mode that it is in.
    pub fn mode(&self, state: &[f64]) -> usize {
        let number = self.number.map_or(1.0, |k| state[k]);
        (number as usize).max(1).min(self.modes.len()) - 1
    }
}

/// Whether the mode at a state has the state of this number; of a system of parts the numbers of modes are no states.
pub fn has_state(number: usize, state: &[f64]) -> bool {
    match OWNERS.get(number) {
        None => true,
        Some((None, _)) => false,
        Some((Some(part), modes)) => modes[PARTS[*part].mode(state)],
    }
}

/// The name of a mode; of a system of parts that of the product mode at a state.
pub fn mode_name(mode: usize, state: &[f64]) -> ModeName<'_> {
    ModeName { mode, state }
}

pub struct ModeName<'a> {
    mode: usize,
    state: &'a [f64],
}

impl fmt::Display for ModeName<'_> {
    fn fmt(&self, to: &mut fmt::Formatter) -> fmt::Result {
        if PARTS.is_empty() {
            return to.write_str(MODES[self.mode].name);
        }
        for (k, part) in PARTS.iter().enumerate() {
            let gap = if k == 0 { "" } else { " " };
            write!(to, "{}{}={}", gap, part.name, part.modes[part.mode(self.state)])?;
        }
        Ok(())
    }
}

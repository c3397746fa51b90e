//! Entering a mode: at the start, after a reset, where an input jumps.

use crate::kernel::{Sink, Stop, StopReason};
use crate::math::{finite, max, size};
use crate::model::{E, M, W};
use crate::run::{Chain, Crossing, Run};

/// States of a chain of transitions at one instant that are remembered; of longer ones a few.
const VISITED: usize = 64;

/// What is met on entry.
pub(crate) struct Arrival {
    pub mode: usize,
    pub dimension: usize,
    pub t: f64,
    /// Edges that were not reached before an input jumped.
    pub inside: Option<[bool; M]>,
    /// When the state was reset, before it waited in a strip.
    pub reset_at: f64,
    /// How far off each surface a state is that stood on it: no further off it still does.
    pub stood: [f64; M],
}

impl Arrival {
    /// One at once.
    pub fn at(t: f64, mode: usize, dimension: usize) -> Arrival {
        Arrival { mode, dimension, t, inside: None, reset_at: t, stood: [0.0; M] }
    }
}

impl<S> Run<'_, S> {
    /// The surfaces the state is beyond on entry; those it is on become active.
    fn enter_surfaces(&mut self, arrival: &Arrival, values: &[f64; M]) -> Option<[bool; M]> {
        let (t, x) = (arrival.t, self.x);
        let mut beyond = [false; M];
        let mut then = *values;
        if arrival.reset_at < t && self.values(arrival.reset_at, &x, &mut then) {
            return None;
        }
        for k in 0..self.here().surfaces {
            let r = values[k];
            let noise = max(self.roundoff(k, t, &x, true)?, size(arrival.stood[k]));
            if r > noise && !(then[k] > noise) {
                self.active[k] = true;
                self.emerging[k] = self.rate(k, t, &x)? < 0.0;
            } else if r > noise || (arrival.inside.map_or(false, |inside| inside[k]) && r >= -noise) {
                beyond[k] = true;
            } else if r >= -noise {
                self.active[k] = true;
            }
        }
        Some(beyond)
    }

    /// Edges without an `if` whose surfaces the state has not reached.
    pub(crate) fn mark_inside(&self) -> Option<[bool; M]> {
        let (t, mut values, mut inside) = (self.t, [0.0; M], [false; M]);
        if self.values(t, &self.x, &mut values) {
            return None;
        }
        for (k, edge) in self.here().edges.iter().enumerate() {
            inside[k] = !edge.conditional && values[k] < -self.roundoff(k, t, &self.x, false)?;
        }
        Some(inside)
    }

    /// How far off the surfaces that it stands on the state is.
    pub(crate) fn off(&self) -> Option<[f64; M]> {
        let (mut values, mut off) = ([0.0; M], [0.0; M]);
        if self.values(self.t, &self.x, &mut values) {
            return None;
        }
        for k in 0..self.here().surfaces {
            off[k] = if self.active[k] && !self.emerging[k] { values[k] } else { 0.0 };
        }
        Some(off)
    }
}

impl<S: Sink> Run<'_, S> {
    /// Enter a mode at x, sizes in `scale`, and make the transitions that fire at once.
    pub(crate) fn enter(&mut self, mut arrival: Arrival) -> Result<(), Stop> {
        let mut visited = [(0, [0.0; W]); VISITED];
        let mut count = 0;
        let mut chain = Chain::NEW;
        loop {
            let t = arrival.t;
            self.place(arrival.mode, arrival.dimension, t);
            let n = self.dimension;
            if self.here().is_final {
                return Err(self.stop(StopReason::Final, t));
            }
            let x = self.x;
            let known = visited[..count].iter().any(|(mode, state)| *mode == self.mode && state[..n] == x[..n]);
            if known || (count == VISITED && chain.returns(false, self.mode, &x, n)) {
                return Err(self.stop(StopReason::Zeno, t));
            }
            if count < VISITED {
                visited[count] = (self.mode, x);
                count += 1;
            }
            let (mut values, surfaces) = ([0.0; M], self.here().surfaces);
            let bad = self.values(t, &x, &mut values);
            let beyond = match if bad { None } else { self.enter_surfaces(&arrival, &values) } {
                Some(beyond) if values[..surfaces].iter().all(|r| finite(*r)) => beyond,
                _ => return Err(self.stop(StopReason::NotFinite, t)),
            };
            let edges = self.here().edges;
            let mut fires = [false; E];
            for k in 0..edges.len() {
                fires[k] = beyond[k] && !edges[k].conditional;
            }
            let first = (0..edges.len()).filter(|k| fires[*k]).fold(None, |best, k| match best {
                Some(other) if !self.goes_before(k, other) => best,
                _ => Some(k),
            });
            let k = match first {
                Some(k) => k,
                None if (edges.len()..surfaces).any(|k| beyond[k]) => {
                    return Err(self.stop(StopReason::LeftDomain, t))
                }
                None => return Ok(()),
            };
            if self.limit_reached() {
                return Err(self.stop(StopReason::TransitionLimit, t));
            }
            let mut sizes = [0.0; W];
            for s in 0..n {
                sizes[s] = max(size(x[s]), self.scale[s]);
            }
            fires[k] = false;
            let crossing = Crossing { edge: k, theta: 0.0, time: t, state: x, depth: 0.0 };
            let (after, scale) = match self.reset(&crossing, &sizes) {
                Some(found) => found,
                None => return Err(self.stop(StopReason::NotFinite, t)),
            };
            if self.crowds(&crossing, &after) {
                return Err(self.stop(StopReason::WaitingLimit, t));
            }
            self.record(&crossing, fires, t, &after, true);
            self.x = after;
            self.scale = scale;
            let edge = &edges[k];
            arrival = Arrival::at(t, edge.target, edge.dimension);
        }
    }
}

//! States at given times, as `Execution.sample` of hsdsl has them.

use crate::model::W;
use crate::{Row, Sink, State};

/// The state at a time; at a jump the last one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    pub mode: usize,
    pub state: State,
}

impl Sample {
    pub const NONE: Sample = Sample { mode: 0, state: [f64::NAN; W] };
}

/// A sink that fills samples at times, which never decrease; beyond the end of a run they stay as they are.
pub struct Samples<'a> {
    times: &'a [f64],
    samples: &'a mut [Sample],
    next: usize,
    last: (f64, Sample),
}

impl<'a> Samples<'a> {
    pub fn new(times: &'a [f64], samples: &'a mut [Sample]) -> Samples<'a> {
        Samples { times, samples, next: 0, last: (f64::NAN, Sample::NONE) }
    }

    /// The number of the next time, if it is before a limit.
    fn before(&self, limit: impl Fn(f64) -> bool) -> Option<usize> {
        let next = self.next;
        if next < self.samples.len() && self.times.get(next).map_or(false, |time| limit(*time)) {
            Some(next)
        } else {
            None
        }
    }
}

impl Sink for Samples<'_> {
    fn row(&mut self, row: &Row) {
        while let Some(i) = self.before(|time| time < row.time) {
            let (begin, last) = self.last;
            if begin < self.times[i] {
                self.samples[i] = Sample { mode: last.mode, state: row.between(begin, &last.state, self.times[i]) };
            }
            self.next += 1;
        }
        let mut here = Sample { mode: row.mode, state: [f64::NAN; W] };
        here.state[..row.state.len()].copy_from_slice(row.state);
        self.last = (row.time, here);
        let mut i = self.next;
        while i < self.samples.len() && i < self.times.len() && self.times[i] == row.time {
            self.samples[i] = here;
            i += 1;
        }
    }
}

impl Row<'_> {
    /// The state at a time between the row before, at `begin` and `x`, and this one.
    fn between(&self, begin: f64, x: &State, time: f64) -> State {
        let u = (time - begin) / (self.time - begin);
        let mut state = *x;
        for k in 0..self.state.len() {
            let mut powers = self.piece.chunks(W.max(1)).rev();
            let value = match powers.next() {
                None => self.state[k] - x[k],
                Some(top) => powers.fold(top[k], |y, c| c[k] + u * y),
            };
            state[k] = x[k] + u * value;
        }
        state
    }
}

//! The relaxed scheme: Burden et al. 2013, Fig. 12.

use crate::control::takes_back;
use crate::entry::Arrival;
use crate::kernel::{Sink, State, Stop, StopReason};
use crate::math::{finite, max, min, size};
use crate::model::{E, M, SEGMENTS, W};
use crate::run::{Crossing, Run, Trial};
use crate::surfaces::{Failure, Found};

const MOST_HALVINGS: u32 = 122;

/// A step that ended in a strip at t1: where it left the domain, edges tied with it, and the sizes of the numbers.
struct Event {
    crossing: Crossing,
    tied: [bool; E],
    t1: f64,
    sizes: State,
}

enum Outcome {
    Landed(Event),
    AtBoundary,
}

impl<S: Sink> Run<'_, S> {
    /// Follow the relaxed execution until it stops.
    pub(crate) fn relaxed(&mut self) -> Stop {
        let mut outcome = self.enter(Arrival::at(0.0, self.mode, self.dimension));
        loop {
            if let Err(stop) = outcome {
                return stop;
            }
            outcome = match self.follow() {
                Ok(Outcome::Landed(event)) => self.through_strip(&event),
                Ok(Outcome::AtBoundary) => self.at_boundary(),
                Err(stop) => Err(stop),
            };
        }
    }

    /// Step in the domain until a step ends in a strip, at the segment's end, or nowhere (Fig. 12, lines 3 to 9).
    fn follow(&mut self) -> Result<Outcome, Stop> {
        let adaptive = self.settings.tolerance > 0.0;
        let limit = SEGMENTS[self.segment].end;
        self.reached = f64::NAN;
        self.idle = 0;
        self.creeping = 0;
        self.chatter = 0;
        let (t, x, mut slope) = (self.t, self.x, self.slope);
        if self.flow(t, &x, &mut slope) {
            return Err(self.stop(StopReason::NotFinite, t));
        }
        self.slope = slope;
        while self.t < limit {
            let (mut h, mut ratio, mut halvings, mut last) = (self.control.h, f64::NAN, 0, Failure::TooWrong);
            let (found, t1) = loop {
                let (length, t1) = self.cut(h, limit);
                let mut found = self.attempt(length, t1);
                if adaptive && self.trial.ends && found.is_ok() {
                    ratio = self.error_ratio(length);
                    if ratio > 1.0 {
                        found = Err(Failure::TooWrong);
                    } else if let Some(failure) = self.excursion() {
                        found = Err(failure);
                    }
                }
                match found {
                    Ok(found) => {
                        h = length;
                        break (found, t1);
                    }
                    Err(failure) => last = failure,
                }
                if last == Failure::TooWrong && halvings == 0 {
                    self.reject(length, ratio);
                    h = self.control.h;
                } else {
                    h = length / 2.0;
                    halvings += 1;
                }
                let creeps = self.struggles() || !(self.t + h > self.t);
                if halvings > MOST_HALVINGS || (last == Failure::TooWrong && creeps) {
                    return self.stuck(last).map(Outcome::Landed);
                }
            };
            if ratio == ratio && halvings == 0 {
                self.accept(h, ratio);
            }
            if found.count > 0 || !self.trial.ends {
                let (crossing, tied) = self.choose(&found.crossings[..found.count]);
                let end = if crossing.theta > 0.0 { self.z } else { self.x };
                let sizes = self.sizes(&self.x, &end, crossing.edge);
                return Ok(Outcome::Landed(Event { crossing, tied, t1, sizes }));
            }
            if halvings > 0 || !(t1 > self.t) {
                if let Some(failure) = self.stalls(halvings, last, t1) {
                    return self.stuck(failure).map(Outcome::Landed);
                }
            }
            if adaptive && self.chatters(t1) {
                return self.stuck(Failure::Jump).map(Outcome::Landed);
            }
            self.leave(t1);
            let z = self.z;
            self.append(t1, &z);
            self.t = t1;
            self.x = z;
            self.slope = self.end;
        }
        Ok(Outcome::AtBoundary)
    }

    /// Try one step from (t, x): what it found.
    fn attempt(&mut self, h: f64, t1: f64) -> Result<Found, Failure> {
        let t = self.t;
        self.trial = Trial { t, h, t1, looked: false, ends: false, piece: None };
        let (n, m) = (self.dimension, self.here().surfaces);
        let mut values = [0.0; M];
        if self.step(t, h) || self.values(t1, &self.z, &mut values) {
            return Err(Failure::NotFinite);
        }
        let sum = |numbers: &[f64]| numbers.iter().fold(0.0, |sum, v| sum + v);
        let total = sum(&self.z[..n]) + sum(&values[..m]);
        let largest = values[..m].iter().copied().reduce(max).unwrap_or(0.0);
        if largest <= 0.0 {
            let (z, mut end) = (self.z, self.end);
            if self.flow(t1, &z, &mut end) {
                return Err(Failure::NotFinite);
            }
            self.end = end;
            self.trial.looked = true;
            self.trial.ends = true;
            return if finite(total + sum(&end[..n])) { Ok(Found::NOTHING) } else { Err(Failure::NotFinite) };
        }
        if !finite(total) {
            return Err(Failure::NotFinite);
        }
        let judged = self.judge(&values);
        match judged {
            None => {
                self.trial.ends = false;
                Err(Failure::NotFinite)
            }
            Some(Err(failure)) => {
                self.ends();
                Err(failure)
            }
            Some(Ok(found)) => {
                if self.ends() || found.count > 0 {
                    Ok(found)
                } else {
                    Err(Failure::NotFinite)
                }
            }
        }
    }

    /// The sizes of the numbers that a point between x and z, on the guard of edge k, is computed from.
    fn sizes(&self, x: &State, z: &State, k: usize) -> State {
        let mut found = [0.0; W];
        for s in 0..self.dimension {
            let still = if self.active[k] || z[s] == self.entered[s] { self.scale[s] } else { size(z[s]) };
            found[s] = max(max(size(x[s]), size(z[s])), still);
        }
        found
    }

    /// Guards on which the state is, to round-off or a tie.
    fn standing_on(&self) -> ([Crossing; E], usize) {
        let found = self.standing(self.t, &self.x, self.tie(self.t));
        let (mut crossings, mut count) = ([Crossing::NONE; E], 0);
        for k in 0..E {
            if found[k] {
                crossings[count] = Crossing { edge: k, theta: 0.0, time: self.t, state: self.x, depth: 0.0 };
                count += 1;
            }
        }
        (crossings, count)
    }

    /// No step, however short, stays in the relaxed domain: take a guard reached together with a wall, or stop.
    fn stuck(&self, failure: Failure) -> Result<Event, Stop> {
        let may = !matches!(failure, Failure::TooWrong | Failure::Creeping | Failure::Jump);
        let (crossings, count) = self.standing_on();
        if may && count > 0 {
            let (crossing, tied) = self.choose(&crossings[..count]);
            let sizes = self.sizes(&self.x, &self.x, crossing.edge);
            return Ok(Event { crossing, tied, t1: self.t, sizes });
        }
        let instant = crate::math::root(crate::run::UNIT) * self.t;
        let fast = (0..self.dimension).any(|s| {
            let scale = self.scale_of(s);
            0.0 < scale && scale < instant * size(self.slope[s])
        });
        let reason = match failure {
            Failure::Wall(_) => StopReason::LeftDomain,
            Failure::NotFinite => StopReason::NotFinite,
            Failure::TooWrong | Failure::Creeping if fast => StopReason::NotFinite,
            _ => StopReason::StepUnderflow,
        };
        Err(self.stop(reason, self.t))
    }

    fn strip(&mut self, crossing: &Crossing, rows: &[(f64, f64)]) {
        for (time, depth) in rows {
            self.sink.row(*time, self.mode, &crossing.state, *depth);
        }
    }

    /// Wait in the strip for what is left of the relaxation, then reset (Fig. 12, lines 10 to 14).
    fn through_strip(&mut self, event: &Event) -> Result<(), Stop> {
        let (crossing, t1) = (&event.crossing, event.t1);
        let (t, depth, until, epsilon) = (crossing.time, crossing.depth, self.settings.until, self.settings.relaxation);
        if crossing.theta > 0.0 {
            self.append(t, &crossing.state);
        }
        self.x = crossing.state;
        if self.limit_reached() {
            return Err(self.stop(StopReason::TransitionLimit, t));
        }
        let mut resumed = t1 + (epsilon - depth);
        let reset = self.reset(crossing, &event.sizes);
        if resumed > until + self.tie(until) {
            self.strip(crossing, &[(t, 0.0), (t1, depth), (until, depth + (until - t1))]);
            self.record(crossing, event.tied, f64::NAN, &[0.0; W], false);
            return Err(self.stop(StopReason::Until, until));
        }
        let (after, scale) = match reset {
            Some(found) => found,
            None => return Err(self.stop(StopReason::NotFinite, t)),
        };
        if self.crowds(crossing, &after) {
            return Err(self.stop(StopReason::WaitingLimit, t));
        }
        resumed = min(resumed, until);
        self.strip(crossing, &[(t, 0.0), (t1, depth), (resumed, epsilon)]);
        self.record(crossing, event.tied, resumed, &after, false);
        let mut slope = [0.0; W];
        let unknown = self.flow(t, &crossing.state, &mut slope);
        let (mode, dimension, flowed) = (self.mode, self.dimension, t > self.resumed);
        self.resumed = resumed;
        let edge = &self.here().edges[crossing.edge];
        self.x = after;
        self.scale = scale;
        self.enter(Arrival { reset_at: t, ..Arrival::at(resumed, edge.target, edge.dimension) })?;
        let (here, x, n) = (self.mode, self.x, self.dimension);
        if !self.cascade.returns(flowed, here, &x, n) {
            return Ok(());
        }
        if self.moves_on(mode, dimension, if unknown { None } else { Some(slope) }) {
            return Err(self.stop(StopReason::Zeno, self.t));
        }
        Ok(())
    }

    /// Whether flows of two modes that lead to and fro do more than undo each other: strips would freeze the rest.
    fn moves_on(&self, mode: usize, dimension: usize, before: Option<State>) -> bool {
        if mode == self.mode {
            return false;
        }
        let mut other = [0.0; W];
        match before {
            Some(slope) if !self.flow(self.t, &self.x, &mut other) => {
                dimension != self.dimension || !takes_back(&slope, &other, dimension)
            }
            _ => true,
        }
    }

    /// Go on behind a sample of an input, or end: a jump at the end is made, and a guard reached there fires.
    fn at_boundary(&mut self) -> Result<(), Stop> {
        let t = self.t;
        if t < self.settings.until || self.segment + 1 < SEGMENTS.len() {
            return self.go_on();
        }
        let (crossings, count) = self.standing_on();
        if count == 0 {
            return Err(self.stop(StopReason::Until, t));
        }
        if self.limit_reached() {
            return Err(self.stop(StopReason::TransitionLimit, t));
        }
        let (crossing, tied) = self.choose(&crossings[..count]);
        self.strip(&crossing, &[(t, 0.0)]);
        self.record(&crossing, tied, f64::NAN, &[0.0; W], false);
        Err(self.stop(StopReason::Until, t))
    }

    /// Enter the next segment of the inputs: anew where one of them jumps.
    fn go_on(&mut self) -> Result<(), Stop> {
        let (t, mode, dimension) = (self.t, self.mode, self.dimension);
        let next = SEGMENTS.iter().rposition(|segment| segment.start <= t).unwrap_or(0);
        if SEGMENTS[next].jump {
            return match (self.mark_inside(), self.off()) {
                (Some(inside), Some(stood)) => {
                    self.enter(Arrival { inside: Some(inside), stood, ..Arrival::at(t, mode, dimension) })
                }
                _ => Err(self.stop(StopReason::NotFinite, t)),
            };
        }
        let (active, emerging) = (self.active, self.emerging);
        self.place(mode, dimension, t);
        self.active = active;
        self.emerging = emerging;
        Ok(())
    }
}

//! The step size, fixed or from the embedded error estimate; and when to stop trying shorter steps.

use crate::kernel::State;
use crate::math::{finite, max, min, power, size};
use crate::model::{METHOD, W};
use crate::run::{Run, UNIT};
use crate::surfaces::Failure;

const ALMOST: f64 = 1.0 - 1.0 / 1073741824.0;
const LEAST: f64 = 0.2;
const MOST: f64 = 5.0;
const SHARE: f64 = 32.0;
const NOISE_UNITS: f64 = 64.0;
const BLUR_UNITS: f64 = 4.0;
const PARALLEL: f64 = 1e-6;
const MOST_REJECTIONS: u32 = 2000;
const MOST_IDLE: u32 = 64;
const MOST_CREEPING: u32 = 2000;
const MOST_CHATTER: i32 = 2000;

impl<S> Run<'_, S> {
    /// Length and end of a step from t, which is stretched to the limit where it nearly gets there.
    pub(crate) fn cut(&self, h: f64, limit: f64) -> (f64, f64) {
        if h < (limit - self.t) * ALMOST {
            (h, self.t + h)
        } else {
            (limit - self.t, limit)
        }
    }

    fn ratio_to(&self, h: f64, error: &State, scales: &State) -> f64 {
        let (tolerance, tiny) = (self.settings.tolerance, h <= self.control.least);
        let nothing = f64::from_bits((1023 - 960) << 52);
        let mut worst = 0.0;
        for s in 0..self.dimension {
            let end = size(self.z[s]);
            let length = max(scales[s], end);
            if size(error[s]) <= nothing || (tiny && self.scale_of(s) <= tolerance * end) {
                continue;
            }
            worst = max(worst, if length > 0.0 { size(error[s]) / (tolerance * length) } else { 1.0 / tolerance });
        }
        worst
    }

    /// Error ratio of a step of length h from x to z; at most 1 is acceptable.
    pub(crate) fn error_ratio(&mut self, h: f64) -> f64 {
        let error = self.error(h);
        let mut scales = [0.0; W];
        for s in 0..self.dimension {
            scales[s] = self.scale_of(s);
        }
        let ratio = self.ratio_to(h, &error, &scales);
        if !(ratio > 1.0) {
            return ratio;
        }
        let again = self.t == self.control.failed_at;
        self.control.failed_at = self.t;
        if !self.control.closer && !again {
            return ratio;
        }
        match self.resolved(h, &scales) {
            None => ratio,
            Some(found) => {
                let closer = self.ratio_to(h, &error, &found);
                self.control.closer = closer <= 1.0;
                closer
            }
        }
    }

    /// The sizes of the terms of a flow: a bound on them where it jumps.
    fn terms(&self, slope: &State, moved: &State) -> Option<State> {
        let Some(bound) = self.here().terms else { return self.flow_terms(slope, moved) };
        let (n, mut both, mut found) = (self.dimension, [0.0; 2 * W], [0.0; W]);
        both[..n].copy_from_slice(&self.x[..n]);
        both[n..2 * n].copy_from_slice(&moved[..n]);
        if bound(&self.p, self.t, &both[..2 * n], &mut found) {
            return None;
        }
        Some(found)
    }

    /// The same of one that does not, by what the last digits of the states `moved` change in it.
    fn flow_terms(&self, slope: &State, moved: &State) -> Option<State> {
        let by = |probe: usize, s: usize| [2.0, -2.0, 6.0, -6.0][(s / 4_usize.pow(probe as u32) + probe) % 4] * UNIT;
        let mut found = [0.0; W];
        for probe in 0..4 {
            let (mut near, mut other) = (self.x, [0.0; W]);
            for s in 0..self.dimension {
                near[s] = self.x[s] + by(probe, s) * moved[s];
            }
            if self.flow(self.t + by(probe, self.dimension) * self.t, &near, &mut other) {
                return None;
            }
            for s in 0..self.dimension {
                found[s] = max(found[s], size(other[s] - slope[s]));
            }
        }
        for s in 0..self.dimension {
            found[s] /= BLUR_UNITS * UNIT;
        }
        Some(found)
    }

    /// Scales, none below a share of what the terms of the flow could move the state by in a step.
    fn resolved(&self, h: f64, scales: &State) -> Option<State> {
        let n = self.dimension;
        let (mut slope, mut moved, mut lifted) = ([0.0; W], *scales, [false; W]);
        let share = max(SHARE, max(self.settings.tolerance, 0.0) / (NOISE_UNITS * UNIT));
        if self.flow(self.t, &self.x, &mut slope) {
            return None;
        }
        for _ in 0..n {
            let least = self.terms(&slope, &moved)?;
            let mut further = false;
            for s in 0..n {
                let length = h * least[s];
                if !(finite(length) && length > share * scales[s]) {
                    continue;
                }
                moved[s] = max(moved[s], length);
                further |= !lifted[s];
                lifted[s] = true;
            }
            if !further {
                break;
            }
        }
        for s in 0..n {
            moved[s] = max(scales[s], moved[s] / share);
        }
        Some(moved)
    }

    fn factor(&self, ratio: f64) -> f64 {
        if ratio == 0.0 {
            return MOST;
        }
        min(MOST, max(LEAST, 0.9 * power(ratio, -1.0 / (ratio * 0.0 + f64::from(METHOD.order)))))
    }

    pub(crate) fn accept(&mut self, taken: f64, ratio: f64) {
        let proposed = taken * self.factor(ratio);
        let control = &mut self.control;
        control.accepted += 1;
        control.stretch += taken;
        if control.stretch > self.settings.largest * 1e-3 {
            control.accepted = 0;
            control.rejected = 0;
            control.stretch = 0.0;
        }
        control.h = min(self.settings.largest, if taken < control.h { max(proposed, control.h) } else { proposed });
    }

    pub(crate) fn reject(&mut self, taken: f64, ratio: f64) {
        self.control.rejected += 1;
        self.control.h = taken * min(1.0, self.factor(ratio));
    }

    /// Whether rejections keep pace with steps for a stretch of time.
    pub(crate) fn struggles(&self) -> bool {
        self.control.rejected > MOST_REJECTIONS && 4 * self.control.rejected > self.control.accepted
    }

    /// Count a step from x to z that was halved because of `failure`; say what ends the run, if anything.
    pub(crate) fn stalls(&mut self, halvings: u32, failure: Failure, t1: f64) -> Option<Failure> {
        if self.t != self.reached {
            self.idle = 0;
            self.creeping = 0;
        }
        self.reached = t1;
        let small = t1 - self.t <= 64.0 * UNIT * max(self.t, self.control.h);
        let still = failure.surface().map_or(false, |k| {
            let before = self.surface(k, self.t, &self.x);
            before.is_some() && before == self.surface(k, t1, &self.z)
        });
        self.idle = if small || still { self.idle + 1 } else { 0 };
        self.creeping = if halvings >= 10 { self.creeping + 1 } else { 0 };
        let n = self.dimension;
        if self.idle > MOST_IDLE || (small && self.z[..n] == self.x[..n]) {
            return Some(failure);
        }
        if self.creeping > MOST_CREEPING {
            Some(Failure::Creeping)
        } else {
            None
        }
    }

    /// Count a step; whether it is one of very many to and fro across a jump of the flow.
    pub(crate) fn chatters(&mut self, t1: f64) -> bool {
        let n = self.dimension;
        let turns = (0..n).any(|s| self.slope[s] * self.end[s] < 0.0);
        if turns {
            self.chatter += 2;
        } else if self.chatter > 0 {
            self.chatter -= 1;
        }
        if self.chatter < MOST_CHATTER {
            return false;
        }
        self.chatter = 0;
        (0..n).any(|s| self.slope[s] * self.end[s] < 0.0 && self.jumps(s, t1).unwrap_or(false))
    }

    /// Component k of the flow at the share s of the way from (t, x) to (t1, z).
    fn flow_between(&self, k: usize, t1: f64, s: f64) -> Option<f64> {
        let (mut at, mut flow) = (self.x, [0.0; W]);
        for i in 0..self.dimension {
            at[i] = self.x[i] + s * (self.z[i] - self.x[i]);
        }
        if self.flow(self.t + s * (t1 - self.t), &at, &mut flow) {
            None
        } else {
            Some(flow[k])
        }
    }

    fn jumps(&self, k: usize, t1: f64) -> Option<bool> {
        let (mut low, mut high) = (0.0, 1.0);
        let (mut before, mut behind) = (self.flow_between(k, t1, low)?, self.flow_between(k, t1, high)?);
        let whole = size(behind - before);
        for _ in 0..40 {
            let middle = (low + high) / 2.0;
            let value = self.flow_between(k, t1, middle)?;
            if size(value - before) >= size(behind - value) {
                high = middle;
                behind = value;
            } else {
                low = middle;
                before = value;
            }
        }
        Some(whole > 0.0 && 2.0 * size(behind - before) >= whole)
    }
}

/// Whether one direction is opposite to another that is not zero.
pub(crate) fn takes_back(slope: &State, back: &State, n: usize) -> bool {
    let share = (0..n).find(|&s| slope[s] != 0.0).map_or(0.0, |s| back[s] / slope[s]);
    share < 0.0 && (0..n).all(|s| size(back[s] - share * slope[s]) <= PARALLEL * size(share) * size(slope[s]))
}


//! Geometry of a trial step against a mode's surfaces: round-off, depth, and where a surface was crossed.
//!
//! `None` says that a routine has no value.

use crate::kernel::State;
use crate::math::{finite, max, min, root, size};
use crate::model::{CONTACTS, D, E, M, P, W};
use crate::run::{Crossing, Run, UNIT};
use crate::table::Piece;

const ROUNDOFF_UNITS: f64 = 32.0;
const ZERO_UNITS: f64 = 16.0;
const HELD: f64 = 2.0;
const SCAN: usize = 8;
const ROOT_ITERATIONS: usize = 200;

/// Why a trial step ends outside the relaxed domain, and at which surface.
#[derive(Clone, Copy, PartialEq)]
pub enum Failure {
    Wall(usize),
    Deep(usize),
    Flat(usize),
    Inward(usize),
    NotFinite,
    TooWrong,
    Creeping,
    Jump,
}

impl Failure {
    pub fn surface(self) -> Option<usize> {
        match self {
            Failure::Wall(k) | Failure::Deep(k) | Failure::Flat(k) | Failure::Inward(k) => Some(k),
            _ => None,
        }
    }
}

/// Crossings of a step that ended in strips; none where it ended inside.
pub(crate) struct Found {
    pub count: usize,
    pub crossings: [Crossing; E],
}

impl Found {
    pub const NOTHING: Found = Found { count: 0, crossings: [Crossing::NONE; E] };
}

type Judged = Option<Result<Found, Failure>>;

impl<S> Run<'_, S> {
    pub(crate) fn surface(&self, k: usize, t: f64, x: &State) -> Option<f64> {
        let mut values = [0.0; M];
        if self.values(t, x, &mut values) {
            None
        } else {
            Some(values[k])
        }
    }

    fn gradient(&self, k: usize, t: f64, x: &State) -> Option<[f64; W + 1]> {
        let mut g = [0.0; W + 1];
        if (self.here().gradients[k])(&self.p, t, x, &mut g) {
            None
        } else {
            Some(g)
        }
    }

    pub(crate) fn rate(&self, k: usize, t: f64, x: &State) -> Option<f64> {
        let mut rate = [0.0];
        if (self.here().rates[k])(&self.p, t, x, &mut rate) {
            None
        } else {
            Some(rate[0])
        }
    }

    /// Below this surface k counts as zero at a point; where its gradient has no value only the sides count.
    pub(crate) fn roundoff(&self, k: usize, t: f64, x: &State, entry: bool) -> Option<f64> {
        let mut magnitudes = [0.0; M];
        if (self.here().magnitudes)(&self.p, t, x, &mut magnitudes) {
            return None;
        }
        let mut total = magnitudes[k];
        let n = self.dimension;
        if let Some(g) = self.gradient(k, t, x) {
            if finite(g[..=n].iter().fold(0.0, |sum, v| sum + v)) {
                total += size(g[0]) * size(t);
                let scaled = entry || self.active[k];
                for s in 0..n {
                    total += size(g[s + 1]) * max(size(x[s]), if scaled { size(self.scale[s]) } else { 0.0 });
                }
            }
        }
        Some(ROUNDOFF_UNITS * UNIT * total)
    }

    /// Whether the `if` of edge k holds. A part that is false decides, even if another has no value.
    pub(crate) fn condition(&self, k: usize, t: f64, x: &State) -> Option<bool> {
        let mut answer = Some(true);
        for part in self.here().edges[k].condition {
            let mut holds = [0.0];
            if part(&self.p, t, x, &mut holds) {
                answer = None;
            } else if holds[0] == 0.0 {
                return Some(false);
            }
        }
        answer
    }

    /// Edges on whose guards a state is, to round-off or within a time, the flow pointing out and `if` true.
    pub(crate) fn standing(&self, t: f64, x: &State, since: f64) -> [bool; E] {
        let mut found = [false; E];
        for k in 0..self.here().edges.len() {
            found[k] = self.stands(k, t, x, since).unwrap_or(false);
        }
        found
    }

    fn stands(&self, k: usize, t: f64, x: &State, since: f64) -> Option<bool> {
        let (r, rate) = (self.surface(k, t, x)?, self.rate(k, t, x)?);
        let near = size(r) <= max(self.roundoff(k, t, x, false)?, rate * since);
        if near && self.points_out(k, t, x, rate)? {
            self.condition(k, t, x)
        } else {
            Some(false)
        }
    }

    /// Whether the flow points out of surface k, beyond the round-off of its rate.
    fn points_out(&self, k: usize, t: f64, x: &State, rate: f64) -> Option<bool> {
        if !(rate > 0.0) {
            return Some(false);
        }
        let (g, mut slope) = (self.gradient(k, t, x)?, [0.0; W]);
        if self.flow(t, x, &mut slope) {
            return None;
        }
        let terms = (0..self.dimension).fold(size(g[0]), |sum, s| sum + size(g[s + 1]) * size(slope[s]));
        Some(rate > ROUNDOFF_UNITS * UNIT * terms)
    }

    /// Forget the surfaces that the state was on and has left.
    pub(crate) fn leave(&mut self, t: f64) {
        let z = self.z;
        for k in 0..self.here().surfaces {
            if !self.active[k] && !self.emerging[k] {
                continue;
            }
            if let Some(r) = self.surface(k, t, &z) {
                let left = self.roundoff(k, t, &z, false).map_or(false, |noise| size(r) > noise);
                self.active[k] &= !left;
                let falls = self.rate(k, t, &z).map_or(true, |rate| rate < 0.0);
                self.emerging[k] &= !(r <= 0.0) && falls;
            }
        }
    }

    /// Look at the flow at a trial's end once; beyond a guard it need not have a value.
    pub(crate) fn ends(&mut self) -> bool {
        if !self.trial.looked {
            self.trial.looked = true;
            let (t1, z, mut end) = (self.trial.t1, self.z, self.end);
            let bad = self.flow(t1, &z, &mut end);
            self.end = end;
            self.trial.ends = !bad && finite(end[..self.dimension].iter().fold(0.0, |sum, v| sum + v));
        }
        self.trial.ends
    }

    /// The step's interpolant.
    pub(crate) fn piece(&mut self) -> Option<Piece> {
        if self.trial.piece.is_none() {
            self.trial.piece = if self.ends() {
                Some(self.table_piece(self.trial.t, self.trial.h)?)
            } else {
                Some(Piece::secant(&self.x, &self.z, self.dimension))
            };
        }
        self.trial.piece
    }

    fn on_piece(&self, piece: &Piece, k: usize, s: f64) -> Option<f64> {
        self.surface(k, self.trial.t + s * self.trial.h, &piece.at(&self.x, self.dimension, s))
    }

    /// A surface that a step went beyond and came back from, on its interpolant.
    pub(crate) fn excursion(&mut self) -> Option<Failure> {
        if !self.ends() {
            return None;
        }
        for k in 0..self.here().surfaces {
            let out = self.rate_along(k, self.trial.t, &self.x, &self.slope);
            let back = self.rate_along(k, self.trial.t1, &self.z, &self.end);
            if let (Some(out), Some(back)) = (out, back) {
                let looked = self.active[k] || (out > 0.0 && 0.0 >= back);
                if looked && self.beyond_within(k) == Some(true) {
                    return Some(Failure::Deep(k));
                }
            }
        }
        None
    }

    fn rate_along(&self, k: usize, t: f64, x: &State, flow: &State) -> Option<f64> {
        let g = self.gradient(k, t, x)?;
        Some((0..self.dimension).fold(g[0], |rate, s| rate + g[s + 1] * flow[s]))
    }

    /// Whether a step is beyond surface k on the way: at its eighths, and then ever nearer around the highest point.
    fn beyond_within(&mut self, k: usize) -> Option<bool> {
        let (t, h, x, t1, z) = (self.trial.t, self.trial.h, self.x, self.trial.t1, self.z);
        let (mut place, mut top, mut width) = (0.0, self.surface(k, t, &x)?, 1.0 / SCAN as f64);
        if top > self.roundoff(k, t, &x, false)? || self.surface(k, t1, &z)? > self.roundoff(k, t1, &z, false)? {
            return Some(false); // transparent, and beyond already, or crossed
        }
        let (mut shares, mut count) = ([0.0; SCAN], SCAN - 1);
        for i in 1..SCAN {
            shares[i - 1] = i as f64 / SCAN as f64;
        }
        while count > 0 {
            let (crest, mut least) = (top, top);
            for s in &shares[..count] {
                let (time, point) = (t + s * h, self.piece()?.at(&x, self.dimension, *s));
                let r = self.surface(k, time, &point)?;
                if r > 0.0 && r > self.roundoff(k, time, &point, false)? {
                    return Some(true);
                }
                if r > top {
                    (place, top) = (*s, r);
                } else if r < least {
                    least = r;
                }
            }
            let within = count == 2 && top == crest;
            if !(width * h > self.settings.relaxation) || (within && top + (top - least) <= 0.0) {
                break;
            }
            width /= 2.0;
            count = 0;
            for s in [place - width, place + width] {
                if s > 0.0 && s < 1.0 {
                    shares[count] = s;
                    count += 1;
                }
            }
        }
        Some(false)
    }

    /// Whether a trial's end is in the relaxed domain: inside (no crossing), in strips, or neither.
    pub(crate) fn judge(&mut self, values: &[f64; M]) -> Judged {
        let (count, edges, t1, z) = (self.here().surfaces, self.here().edges.len(), self.trial.t1, self.z);
        for k in 0..count {
            if !(values[k] <= 0.0) {
                self.noise[k] = self.roundoff(k, t1, &z, false)?;
            }
        }
        for k in 0..count {
            if values[k] <= 0.0 || values[k] <= self.noise[k] {
                continue;
            }
            if k >= edges && !self.emerging[k] {
                return Some(Err(Failure::Wall(k)));
            }
            if !self.is_transparent(k) {
                if let Some(failure) = self.too_deep(k, values[k])? {
                    return Some(Err(failure));
                }
            }
        }
        let mut found = Found::NOTHING;
        for k in 0..edges {
            if values[k] <= 0.0 || values[k] <= self.noise[k] {
                continue;
            }
            match self.crossing(k, values[k])? {
                Err(failure) => return Some(Err(failure)),
                Ok(Some(crossing)) => {
                    found.crossings[found.count] = crossing;
                    found.count += 1;
                }
                Ok(None) => {}
            }
        }
        Some(Ok(found))
    }

    /// Whether a state may be beyond surface k without having crossed it.
    fn is_transparent(&self, k: usize) -> bool {
        let edges = self.here().edges;
        self.emerging[k] || k >= edges.len() || edges[k].conditional
    }

    /// |grad r| in (t, x).
    fn norm(&self, k: usize, t: f64, x: &State) -> Option<f64> {
        let g = self.gradient(k, t, x)?;
        Some(root(g[..=self.dimension].iter().fold(0.0, |sum, v| sum + v * v)))
    }

    fn too_deep(&self, k: usize, value: f64) -> Option<Option<Failure>> {
        let norm = self.norm(k, self.trial.t1, &self.z)?;
        if !(norm > 0.0) {
            return Some(Some(Failure::Flat(k)));
        }
        let within = value <= self.settings.relaxation * norm + self.noise[k];
        Some(if within { None } else { Some(Failure::Deep(k)) })
    }

    /// The last up-crossing of surface k; none where it is transparent there.
    fn crossing(&mut self, k: usize, value: f64) -> Option<Result<Option<Crossing>, Failure>> {
        let mut piece = self.piece()?;
        let mut crossing = match self.crossed_on(&piece, k)? {
            None => return Some(Ok(None)),
            Some(crossing) => crossing,
        };
        let norm = self.norm(k, self.trial.t1, &self.z)?;
        let mut inward = self.inward(k, &crossing)?;
        if inward != 0.0 && inward <= self.settings.relaxation * norm {
            if self.trial.ends {
                piece = Piece::hermite(self.trial.h, &self.x, &self.z, &self.slope, &self.end, self.dimension);
            }
            crossing = self.crossed_on(&piece, k)?.unwrap_or(crossing);
            inward = self.inward(k, &crossing)?;
        }
        if inward != 0.0 {
            return Some(Err(Failure::Inward(k)));
        }
        if !self.condition(k, crossing.time, &crossing.state)? {
            let on = crossing.theta == 0.0 || self.active[k];
            if !(on && self.holds_after_hop(&piece, k, &crossing, value)?) {
                return Some(Ok(None));
            }
        }
        if let Some(failure) = self.too_deep(k, value)? {
            return Some(Err(failure));
        }
        for i in 1..SCAN {
            let s = crossing.theta + (1.0 - crossing.theta) * i as f64 / SCAN as f64;
            if self.on_piece(&piece, k, s)? > value + self.noise[k] {
                return Some(Err(Failure::Deep(k)));
            }
        }
        crossing.depth = min(self.settings.relaxation, value / norm);
        Some(Ok(Some(crossing)))
    }

    /// How far the flow at a crossing would take r back inside over this step; 0 when not beyond round-off.
    fn inward(&self, k: usize, crossing: &Crossing) -> Option<f64> {
        let back = -self.rate(k, crossing.time, &crossing.state)? * self.trial.h;
        Some(if back > self.noise[k] { back } else { 0.0 })
    }

    /// Whether the `if` of edge k holds next, on whose surface the state is, after a hop that round-off hides: where the
    /// flow comes back to the surface, which is at `end` at the step's end.
    fn holds_after_hop(&self, piece: &Piece, k: usize, crossing: &Crossing, end: f64) -> Option<bool> {
        let back = -self.rate(k, crossing.time, &crossing.state)? * self.trial.h;
        if !(back > 0.0) {
            return Some(self.holds_next(k, crossing.time, &crossing.state));
        }
        let s = crossing.theta + (1.0 - crossing.theta) * (back / (back + end));
        let point = piece.at(&self.x, self.dimension, s);
        Some(self.holds_next(k, self.trial.t + s * self.trial.h, &point))
    }

    /// Whether the `if` of an edge that leads back holds at a point, or next along the flow.
    fn holds_next(&self, k: usize, t: f64, x: &State) -> bool {
        let edge = &self.here().edges[k];
        if !self.returns(edge) {
            return false;
        }
        match self.condition(k, t, x) {
            Some(false) if edge.conditional => {
                self.pressed(k, t, x).map_or(false, |next| self.condition(k, t, &next) == Some(true))
            }
            holds => holds == Some(true),
        }
    }

    /// Where the flow presses a state, by what guard k would take away of it: off by round-off where its reset changes it.
    fn pressed(&self, k: usize, t: f64, x: &State) -> Option<State> {
        let (edge, mut slope, mut after, mut next) = (&self.here().edges[k], [0.0; W], 0.0, *x);
        if self.flow(t, x, &mut slope) {
            return None;
        }
        if let (Some(contact), Some(held)) = (edge.contact, self.here().held) {
            let (mut p, mut left) = ([0.0; P + D + CONTACTS], [0.0; W]);
            p[..P + D].copy_from_slice(&self.p);
            p[P + D + contact] = HELD;
            if held(&p, t, x, &mut left) {
                return None;
            }
            for s in 0..self.dimension {
                slope[s] -= left[s];
            }
        }
        for &s in edge.changes {
            if slope[s] != 0.0 {
                let sized = max(self.scale_of(s), size(self.scale[s]));
                after = max(after, ZERO_UNITS * UNIT * sized / size(slope[s]));
            }
        }
        if !(after > 0.0) {
            after = UNIT * self.settings.until; // where these states have been zero only
        }
        for s in 0..self.dimension {
            next[s] = x[s] + after * slope[s];
        }
        Some(next)
    }

    /// Where surface k was last crossed upwards on an interpolant; none if it was beyond all along.
    fn crossed_on(&self, piece: &Piece, k: usize) -> Option<Option<Crossing>> {
        let (t, h, n) = (self.trial.t, self.trial.h, self.dimension);
        let mut sizes = [0.0; W];
        for s in 0..n {
            sizes[s] = max(size(self.x[s]), size(self.z[s]));
        }
        let small = self.roundoff(k, self.trial.t1, &sizes, false)? * (1.0 / 16.0);
        let theta = match self.last_up_crossing(piece, k, small)? {
            Some(theta) => theta,
            None => {
                let beyond = self.is_transparent(k)
                    && self.on_piece(piece, k, 0.0)? > self.roundoff(k, t, &self.x, false)?;
                if beyond {
                    return Some(None);
                }
                0.0 // on the surface to round-off: it is crossed as the step begins
            }
        };
        let on = theta == 0.0;
        let time = if on { t } else { t + theta * h };
        let state = if on { self.x } else { piece.at(&self.x, n, theta) };
        Some(Some(Crossing { edge: k, theta, time, state, depth: 0.0 }))
    }

    /// The last s in [0, 1] where surface k rises through zero on an interpolant that ends above; none if it never does.
    fn last_up_crossing(&self, piece: &Piece, k: usize, small: f64) -> Option<Option<f64>> {
        let (mut b, mut fb) = (1.0, self.on_piece(piece, k, 1.0)?);
        for i in (0..SCAN).rev() {
            let a = i as f64 / SCAN as f64;
            let fa = self.on_piece(piece, k, a)?;
            if fa <= 0.0 {
                return Some(Some(self.close_bracket(piece, k, (a, fa), (b, fb), small)?));
            }
            b = a;
            fb = fa;
        }
        Some(None)
    }

    /// Close a bracket fa <= 0 < fb by the Illinois variant of regula falsi.
    fn close_bracket(&self, piece: &Piece, k: usize, low: (f64, f64), high: (f64, f64), small: f64) -> Option<f64> {
        let ((mut a, mut fa), (mut b, mut fb)) = (low, high);
        let (mut weight_a, mut weight_b, mut side) = (fa, fb, 0);
        for _ in 0..ROOT_ITERATIONS {
            if -fa <= small || b - a <= 4.0 * UNIT {
                return Some(a);
            }
            if fb <= small {
                return Some(b);
            }
            if weight_b - weight_a == 0.0 {
                return None;
            }
            let mut s = a - weight_a * (b - a) / (weight_b - weight_a);
            if !(a < s && s < b) {
                s = (a + b) / 2.0;
            }
            let f = self.on_piece(piece, k, s)?;
            if f <= 0.0 {
                if side < 0 {
                    weight_b /= 2.0;
                }
                a = s;
                fa = f;
                weight_a = f;
                side = -1;
            } else {
                if side > 0 {
                    weight_a /= 2.0;
                }
                b = s;
                fb = f;
                weight_b = f;
                side = 1;
            }
        }
        Some(a)
    }
}

//! Steps of a table, their interpolants and error estimates; sums go from left to right.

use crate::kernel::{Interpolant, Row, State};
use crate::math::root;
use crate::model::{DEGREE, METHOD, STAGES, W};
use crate::run::Run;

/// x + c_1 s + c_2 s**2 + ...; of degree 0 where it is a point.
#[derive(Clone, Copy)]
pub struct Piece {
    pub degree: usize,
    pub c: [State; DEGREE],
}

impl Piece {
    pub const POINT: Piece = Piece { degree: 0, c: [[0.0; W]; DEGREE] };

    /// The point at s.
    pub fn at(&self, x: &State, n: usize, s: f64) -> State {
        let mut point = *x;
        for i in 0..n {
            let mut v = self.c[self.degree - 1][i] * s;
            for m in (0..self.degree - 1).rev() {
                v = (self.c[m][i] + v) * s;
            }
            point[i] = x[i] + v;
        }
        point
    }

    pub fn secant(x: &State, z: &State, n: usize) -> Piece {
        let mut piece = Piece::POINT;
        piece.degree = 1;
        for i in 0..n {
            piece.c[0][i] = z[i] - x[i];
        }
        piece
    }

    /// The cubic from the ends of a step and the flow there.
    pub fn hermite(h: f64, x: &State, z: &State, slope: &State, end: &State, n: usize) -> Piece {
        let mut piece = Piece::POINT;
        piece.degree = 3;
        for i in 0..n {
            let (a, b, f, g) = (x[i], z[i], slope[i], end[i]);
            piece.c[0][i] = h * f;
            piece.c[1][i] = 3.0 * (b - a) - h * (2.0 * f + g);
            piece.c[2][i] = h * (f + g) - 2.0 * (b - a);
        }
        piece
    }
}

pub fn weighted(row: Row, stages: &[State; STAGES], i: usize) -> f64 {
    let mut terms = row.iter();
    match terms.next() {
        None => 0.0,
        Some(&(stage, weight)) => terms.fold(weight * stages[stage][i], |sum, &(k, w)| sum + w * stages[k][i]),
    }
}

impl<S> Run<'_, S> {
    /// Evaluate stage i of a step; true where the flow has no value.
    fn evaluate(&mut self, i: usize, t: f64, h: f64) -> bool {
        let mut at = self.x;
        for s in 0..self.dimension {
            at[s] = self.x[s] + h * weighted(METHOD.a[i], &self.stages, s);
        }
        let mut found = self.stages[i];
        let bad = self.flow(t + METHOD.nodes[i] * h, &at, &mut found);
        self.stages[i] = found;
        bad
    }

    /// One step from (t, x) to z; true where the flow has no value.
    pub(crate) fn step(&mut self, t: f64, h: f64) -> bool {
        self.stages[0] = self.slope;
        for i in 1..METHOD.stages {
            if self.evaluate(i, t, h) {
                return true;
            }
        }
        for s in 0..self.dimension {
            self.z[s] = self.x[s] + h * weighted(METHOD.b, &self.stages, s);
        }
        false
    }

    /// The method's own interpolant of the step from (t, x) to z; none where the flow has no value.
    pub(crate) fn table_piece(&mut self, t: f64, h: f64) -> Option<Piece> {
        let n = self.dimension;
        if METHOD.interpolant == Interpolant::Hermite {
            return Some(Piece::hermite(h, &self.x, &self.z, &self.slope, &self.end, n));
        }
        if METHOD.interpolant == Interpolant::Secant {
            return Some(Piece::secant(&self.x, &self.z, n));
        }
        self.stages[METHOD.stages] = self.end;
        for i in 0..METHOD.extra {
            if self.evaluate(METHOD.stages + 1 + i, t, h) {
                return None;
            }
        }
        let mut piece = Piece::POINT;
        piece.degree = METHOD.dense.len();
        for m in 0..piece.degree {
            for s in 0..n {
                piece.c[m][s] = h * weighted(METHOD.dense[m], &self.stages, s);
            }
        }
        Some(piece)
    }

    /// The estimate of the error of a step whose flow at its end is known.
    pub(crate) fn error(&mut self, h: f64) -> State {
        let mut error = [0.0; W];
        self.stages[METHOD.stages] = self.end;
        for s in 0..self.dimension {
            error[s] = h * weighted(METHOD.error, &self.stages, s);
            if !METHOD.coarse.is_empty() {
                error[s] = sharpened(error[s], h * weighted(METHOD.coarse, &self.stages, s));
            }
        }
        error
    }
}

/// One error estimate of two.
fn sharpened(fine: f64, coarse: f64) -> f64 {
    let square = fine * fine;
    let total = square + coarse * coarse / 100.0;
    if total > 0.0 {
        square / root(total)
    } else {
        square
    }
}

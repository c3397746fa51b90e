//! The first transitions are those that hsdsl made with the same settings.

mod expected;

use expected::{END, MOST, REASON, TRANSITIONS};
use hybrid::model::{initial, parameters, MODES, SCALES, SETTINGS, START};
use hybrid::{simulate, Settings, Sink, Transition};

const ALLOWED: f64 = 1e-9; // relative to the length of the run, and to the sizes of states

struct Kept(Vec<Transition>);

impl Sink for Kept {
    fn transition(&mut self, made: &Transition) {
        self.0.push(*made);
    }
}

fn same(found: f64, wanted: f64, size: f64) -> bool {
    (found.is_nan() && wanted.is_nan()) || (found - wanted).abs() <= ALLOWED * size.abs().max(wanted.abs())
}

#[test]
fn transitions_are_those_of_hsdsl() {
    let p = parameters();
    let settings = Settings { max_transitions: MOST, ..SETTINGS };
    let mut kept = Kept(Vec::new());
    let stop = simulate(&p, &settings, START, &initial(&p), &SCALES, &mut kept);
    assert_eq!(format!("{:?}", stop.reason), REASON);
    assert!(same(stop.time, END, settings.until), "ends at {:?}, expected {:?}", stop.time, END);
    assert_eq!(kept.0.len(), TRANSITIONS.len());
    for (made, wanted) in kept.0.iter().zip(TRANSITIONS) {
        let (time, resumed, mode, edge, entry, after) = wanted;
        let name = MODES[made.mode].edges[made.edge].name;
        assert_eq!((made.mode, name, made.entry), (*mode, *edge, *entry));
        assert!(same(made.time, *time, settings.until), "made at {:?}, expected {:?}", made.time, time);
        assert!(same(made.resumed, *resumed, settings.until));
        let size = made.before.iter().chain(after.iter()).fold(0.0, |a: f64, b| a.max(b.abs()));
        assert!(made.after.iter().zip(after.iter()).all(|(a, b)| same(*a, *b, size)), "{:?}, expected {:?}", made, wanted);
    }
}

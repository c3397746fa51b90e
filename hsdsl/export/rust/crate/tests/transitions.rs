//! The first transitions are those that hsdsl made with the same settings.

mod expected;

use expected::{END, MOST, REASON, TRANSITIONS};
use hybrid::model::{initial, parameters, MODES, SCALES, SETTINGS, START};
use hybrid::{simulate, Settings, Sink, Transition, MEMORY};

const ALLOWED: f64 = 1e-9; // relative to the length of the run: another C library rounds `sin` otherwise

struct Kept(Vec<Transition>);

impl Sink for Kept {
    fn transition(&mut self, made: &Transition) {
        self.0.push(*made);
    }
}

fn same(found: f64, wanted: f64) -> bool {
    let size = SETTINGS.until.max(wanted.abs());
    (found.is_nan() && wanted.is_nan()) || (found - wanted).abs() <= ALLOWED * size
}

#[test]
fn transitions_are_those_of_hsdsl() {
    let p = parameters();
    let settings = Settings { max_transitions: MOST, ..SETTINGS };
    let (mut kept, mut memory) = (Kept(Vec::new()), vec![0; MEMORY]);
    let stop = simulate(&p, &settings, START, &initial(&p), &SCALES, &mut memory, &mut kept).expect("it can run");
    assert_eq!(stop.reason.word(), REASON);
    assert!(same(stop.time, END), "ends at {:?}, expected {:?}", stop.time, END);
    assert_eq!(kept.0.len(), TRANSITIONS.len());
    for (made, wanted) in kept.0.iter().zip(TRANSITIONS) {
        let (time, resumed, edge, entry) = wanted;
        assert_eq!((MODES[made.mode].edges[made.edge].name, made.entry), (*edge, *entry));
        assert!(same(made.time, *time), "made at {:?}, expected {:?}", made.time, time);
        assert!(same(made.resumed, *resumed), "{:?}, expected {:?}", made.resumed, resumed);
    }
}

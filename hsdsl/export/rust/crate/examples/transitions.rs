//! Run the experiment and print its transitions: number, time, when flow went on, edge, and the state behind it.

use hybrid::model::{initial, parameters, MODES, SCALES, SETTINGS, START};
use hybrid::{simulate, Sink, Transition};

struct Print(usize);

impl Sink for Print {
    fn transition(&mut self, made: &Transition) {
        let edge = &MODES[made.mode].edges[made.edge];
        let after = &made.after[..edge.dimension];
        println!("{} {:?} {:?} {} {:?}", self.0, made.time, made.resumed, edge.name, after);
        self.0 += 1;
    }
}

fn main() {
    let p = parameters();
    let stop = simulate(&p, &SETTINGS, START, &initial(&p), &SCALES, &mut Print(0));
    let state = &stop.state[..MODES[stop.mode].dimension];
    println!("{:?} {:?} {} {:?}", stop.reason, stop.time, MODES[stop.mode].name, state);
}

//! Run the experiment and print it as `hsdsl run --json` does: transitions, why it ended, and the last state.

use hybrid::model::{initial, parameters, MODES, OUTPUT_NAMES, SCALES, SETTINGS, START};
use hybrid::{has_state, mode_name, simulate, Sink, Transition, MEMORY};

struct Print(usize);

fn number(value: f64) -> String {
    if value.is_finite() {
        format!("{:?}", value)
    } else {
        String::from("null")
    }
}

fn text(value: &str) -> String {
    let signs = value.chars().map(|sign| match sign {
        '"' | '\\' => format!("\\{}", sign),
        _ if (sign as u32) < 0x20 => format!("\\u{:04x}", sign as u32),
        _ => sign.to_string(),
    });
    format!("\"{}\"", signs.collect::<String>())
}

/// The states by name, without what events remember, whose names have an `@`.
fn states(names: &[&str], values: &[f64]) -> String {
    let had = (0..names.len()).filter(|s| has_state(*s, values) && !names[*s].contains('@'));
    let items: Vec<_> = had.map(|s| format!("{}: {}", text(names[s]), number(values[s]))).collect();
    format!("{{{}}}", items.join(", "))
}

impl Sink for Print {
    fn transition(&mut self, made: &Transition) {
        let mode = &MODES[made.mode];
        let edge = &mode.edges[made.edge];
        let tied: Vec<_> = made.tied.iter().flatten().map(|k| text(mode.edges[*k].name)).collect();
        let after = if made.resumed.is_nan() { String::from("null") } else { states(edge.states, &made.after) };
        println!(
            "{}{{\"index\": {}, \"time\": {}, \"resumed\": {}, \"edge\": {}, \"from\": {}, \"to\": {}, \
             \"before\": {}, \"after\": {}, \"alternatives\": [{}]}}",
            if self.0 == 0 { "" } else { ", " },
            self.0,
            number(made.time),
            number(made.resumed),
            text(edge.name),
            text(&mode_name(made.mode, &made.before).to_string()),
            text(&mode_name(edge.target, &made.after).to_string()),
            states(mode.states, &made.before),
            after,
            tied.join(", "),
        );
        self.0 += 1;
    }
}

fn main() {
    let p = parameters();
    let mut memory = vec![0; MEMORY];
    println!("{{\"transitions\": [");
    let stop = simulate(&p, &SETTINGS, START, &initial(&p), &SCALES, &mut memory, &mut Print(0)).expect("it can run");
    let outputs: Vec<_> =
        OUTPUT_NAMES.iter().zip(&stop.outputs).map(|(name, value)| format!("{}: {}", text(name), number(*value))).collect();
    println!("], \"stop\": {{\"reason\": {}, \"time\": {}}},", text(stop.reason.word()), number(stop.time));
    println!("\"final\": {{\"mode\": {}, ", text(&mode_name(stop.mode, &stop.state).to_string()));
    println!("\"state\": {}, \"outputs\": {{{}}}}}}}", states(stop.states, &stop.state), outputs.join(", "));
}

//! What `c/shim.c` is called with; all that is unsafe.

use crate::model::{DEGREE, E, INITIAL_STATES, MODES, OUTPUTS, P, START, STATES, W};
use crate::{Row, Settings, Sink, State, Stop, StopReason, Transition};
use core::ffi::c_void;
use core::slice::from_raw_parts;

/// How many words of memory a run takes.
pub const MEMORY: usize = include!(concat!(env!("OUT_DIR"), "/words.rs"));

#[repr(C)]
struct RowOfC {
    time: f64,
    depth: f64,
    jump: i64,
    mode: i32,
    strip: i32,
    dimension: i32,
    x: *const f64,
    outputs: *const f64,
    piece: *const f64,
}

#[repr(C)]
struct TransitionOfC {
    time: f64,
    resumed: f64,
    mode: i32,
    edge: i32,
    entry: i32,
    tied: i32,
    tied_with: *const i32,
    before: *const f64,
    after: *const f64,
}

extern "C" {
    #[link_name = "@PREFIX@_hybrid_parameters"]
    fn hybrid_parameters(p: *mut f64);
    #[link_name = "@PREFIX@_hybrid_follow"]
    fn hybrid_follow(p: *mut f64);
    #[link_name = "@PREFIX@_hybrid_initial"]
    fn hybrid_initial(p: *const f64, x: *mut f64);
    #[link_name = "@PREFIX@_hybrid_simulate"]
    fn hybrid_simulate(
        memory: *mut u64,
        p: *const f64,
        settings: *const Settings,
        mode: i32,
        x: *const f64,
        scales: *const f64,
        context: *mut c_void,
        row: unsafe extern "C" fn(*mut c_void, *const RowOfC),
        transition: unsafe extern "C" fn(*mut c_void, *const TransitionOfC),
        time: *mut f64,
    ) -> i32;
}

/// The values of the parameters.
pub fn parameters() -> [f64; P] {
    let mut p = [0.0; P];
    unsafe { hybrid_parameters(p.as_mut_ptr()) };
    p
}

/// Compute the parameters that depend on others again; not-a-number where they have no value.
pub fn follow(p: &mut [f64; P]) {
    unsafe { hybrid_follow(p.as_mut_ptr()) };
}

/// The initial state; not-a-number where it has no value.
pub fn initial(p: &[f64; P]) -> State {
    let mut x = [0.0; W];
    unsafe { hybrid_initial(p.as_ptr(), x.as_mut_ptr()) };
    x
}

struct Call<'a, S> {
    sink: &'a mut S,
    stop: Stop,
}

/// Nothing may unwind through C.
struct Abort;

impl Drop for Abort {
    fn drop(&mut self) {
        panic!("a sink panicked");
    }
}

/// Some numbers of C, none where there are none.
unsafe fn numbers<'a>(from: *const f64, count: usize) -> &'a [f64] {
    if count == 0 {
        &[]
    } else {
        from_raw_parts(from, count)
    }
}

unsafe fn state(from: *const f64) -> State {
    let mut state = [0.0; W];
    state.copy_from_slice(numbers(from, W));
    state
}

unsafe extern "C" fn give_row<S: Sink>(context: *mut c_void, row: *const RowOfC) {
    let (call, row) = (&mut *(context as *mut Call<S>), &*row);
    let given = Row {
        time: row.time,
        jump: row.jump as u64,
        mode: row.mode as usize,
        strip: row.strip != 0,
        depth: row.depth,
        state: numbers(row.x, row.dimension as usize),
        outputs: numbers(row.outputs, OUTPUTS),
        piece: numbers(row.piece, DEGREE * W),
    };
    call.stop.mode = given.mode;
    call.stop.state[..given.state.len()].copy_from_slice(given.state);
    call.stop.outputs.copy_from_slice(given.outputs);
    let abort = Abort;
    call.sink.row(&given);
    core::mem::forget(abort);
}

unsafe extern "C" fn give_transition<S: Sink>(context: *mut c_void, made: *const TransitionOfC) {
    let (call, made) = (&mut *(context as *mut Call<S>), &*made);
    let mut tied = [None; E];
    for (k, edge) in tied.iter_mut().enumerate().take(made.tied as usize) {
        *edge = Some(*made.tied_with.add(k) as usize);
    }
    let given = Transition {
        time: made.time,
        resumed: made.resumed,
        mode: made.mode as usize,
        edge: made.edge as usize,
        entry: made.entry != 0,
        before: state(made.before),
        after: state(made.after),
        tied,
    };
    if !given.resumed.is_nan() {
        call.stop.states = MODES[given.mode].edges[given.edge].states;
    }
    let abort = Abort;
    call.sink.transition(&given);
    core::mem::forget(abort);
}

/// Run what was checked.
pub(crate) fn run<S: Sink>(
    p: &[f64; P],
    settings: &Settings,
    mode: usize,
    x: &State,
    scales: &[f64; STATES],
    memory: &mut [u64],
    sink: &mut S,
) -> Stop {
    let settings = Settings { max_transitions: settings.max_transitions.min(1 << 62), ..*settings };
    let states = if mode == START { INITIAL_STATES } else { MODES[mode].states };
    let stop = Stop { reason: StopReason::Until, time: 0.0, mode, states, state: *x, outputs: [f64::NAN; OUTPUTS] };
    let mut call = Call { sink, stop };
    let mut time = 0.0;
    let context = &mut call as *mut Call<S> as *mut c_void;
    let reason = unsafe {
        hybrid_simulate(
            memory.as_mut_ptr(),
            p.as_ptr(),
            &settings,
            mode as i32,
            x.as_ptr(),
            scales.as_ptr(),
            context,
            give_row::<S>,
            give_transition::<S>,
            &mut time,
        )
    };
    Stop { reason: StopReason::ALL[reason as usize].0, time, ..call.stop }
}

//! A hybrid system and the relaxed scheme that runs it: no standard library, no allocation.
//!
//! `model` is generated from a model; the other modules are the same for every model. They follow Fig. 12 of Burden,
//! Gonzalez, Vasudevan, Bajcsy, Sastry, Metrization and Simulation of Controlled Hybrid Systems (2013).

#![cfg_attr(not(test), no_std)]
#![allow(clippy::needless_range_loop)]

pub mod control;
pub mod entry;
pub mod kernel;
pub mod math;
pub mod model;
pub mod relaxed;
pub mod run;
pub mod surfaces;
pub mod table;

pub use kernel::{Settings, Sink, Stop, StopReason, Transition};
pub use run::{simulate, Run};

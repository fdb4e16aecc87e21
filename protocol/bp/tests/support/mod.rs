//! Programs from scripts in JSON, and what they did.

#![allow(dead_code)] // Each test file uses its part.

use std::time::Duration;

use serde_json::Value;
use skein_bp::script::{Op, Script};
use skein_bp::{Program, ProgramConfig, Selection};

pub const START: Duration = Duration::ZERO;

pub fn script(body: Value) -> Script {
    let ops: Vec<Op> = serde_json::from_value(body).unwrap();
    Script::new(&ops).unwrap()
}

/// A program of scripts; each body is a list of ops.
pub fn program<const N: usize>(config: ProgramConfig, bthreads: [(&str, Value); N]) -> Program {
    let mut program = Program::new(config);
    for (name, body) in bthreads {
        program.add(name, script(body));
    }
    program
}

pub fn plain<const N: usize>(bthreads: [(&str, Value); N]) -> Program {
    program(ProgramConfig::default(), bthreads)
}

pub fn names(selections: &[Selection]) -> Vec<&str> {
    selections.iter().map(|selection| selection.event.name()).collect()
}

/// The events of a whole superstep at the start of time.
pub fn superstep(program: &mut Program) -> Vec<String> {
    program.superstep(START).unwrap().iter().map(|selection| selection.event.to_string()).collect()
}

//! Runs conformance cases: `cargo run --release -p skein-bp --example conformance -- FILE`.
//!
//! Prints a line for each expectation that fails, then the counts. Exits with 1 when something failed, with 2 when
//! the file or one of its cases cannot be understood.

mod suite;

use std::process::ExitCode;

use suite::Suite;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let (Some(file), None) = (arguments.next(), arguments.next()) else {
        eprintln!("usage: conformance FILE");
        return ExitCode::from(2);
    };
    let suite = match read(&file) {
        Ok(suite) => suite,
        Err(problem) => {
            eprintln!("{file}: {problem}");
            return ExitCode::from(2);
        }
    };
    for finding in suite.unsound() {
        eprintln!("{file}: case {finding}");
    }
    let report = suite.check();
    for finding in &report.failures {
        println!("{finding}");
    }
    println!("{report}");
    match (suite.unsound().is_empty(), report.failures.is_empty()) {
        (false, _) => ExitCode::from(2),
        (true, false) => ExitCode::from(1),
        (true, true) => ExitCode::SUCCESS,
    }
}

fn read(file: &str) -> Result<Suite, Box<dyn std::error::Error>> {
    Ok(Suite::parse(&std::fs::read_to_string(file)?)?)
}

//! How fast the verifier is: `cargo run --release -p skein-bp --example dining_philosophers -- 12`.
//!
//! Explores all states of so many dining philosophers and prints how many there are, and how many each second.

use std::process::ExitCode;
use std::time::Instant;

use skein_bp::script::{Op, Script, ScriptError};
use skein_bp::verify::Verifier;
use skein_bp::{Bid, EventSet, Program, ProgramConfig};

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let count =
        arguments.next().and_then(|count| count.parse().ok()).filter(|count| (2..=16).contains(count));
    let (Some(count), None) = (count, arguments.next()) else {
        eprintln!("usage: dining_philosophers COUNT, which is 2 to 16");
        return ExitCode::from(2);
    };
    let program = match philosophers(count) {
        Ok(program) => program,
        Err(problem) => {
            eprintln!("{problem}");
            return ExitCode::FAILURE;
        }
    };
    let began = Instant::now();
    let report = Verifier::new(program).inspect([]).on_progress(|progress| eprintln!("{progress}")).run();
    let seconds = began.elapsed().as_secs_f64();
    println!("{report}");
    println!("{seconds:.2} s, {:.0} states/s", report.states as f64 / seconds);
    ExitCode::SUCCESS
}

/// A ring in which everyone takes the right stick, then the left one.
fn philosophers(count: usize) -> Result<Program, ScriptError> {
    let mut program = Program::new(ProgramConfig::default());
    for i in 1..=count {
        let (right, left) = (format!("{i}R"), format!("{}L", i % count + 1));
        let of_both = |what: &str| EventSet::from([format!("{what}{right}"), format!("{what}{left}")]);
        let (pick, release) = (of_both("Pick"), of_both("Rel"));
        let lies = Op::Sync(Bid::new().wait_for(&pick).block(&release));
        let held = Op::Sync(Bid::new().wait_for(&release).block(&pick));
        program.add(format!("Stick{i}"), Script::new(&[Op::forever([lies, held])])?);
        let acts = [format!("Pick{i}R"), format!("Pick{i}L"), format!("Rel{i}L"), format!("Rel{i}R")];
        let acts = acts.map(|act| Op::Sync(Bid::new().request(act)));
        program.add(format!("Phil{i}"), Script::new(&[Op::forever(acts)])?);
    }
    Ok(program)
}

//! Making a failing story short enough to be read.

use std::fmt;
use std::time::Duration;

use skein_wire::NetworkConfig;

use crate::promise::Violation;
use crate::run::{Outcome, Settings, run};
use crate::story::{Cast, Fault, Ordered, Story};

/// The most runs that shrinking may take.
const MOST_RUNS: usize = 400;
/// How many of the last things that happened are told.
const TOLD: usize = 16;

/// A story that breaks a promise, and nothing in it that is not needed for that.
#[derive(Clone, Debug, PartialEq)]
pub struct Shrunk {
    pub story: Story,
    pub violation: Violation,
    /// The last things that happen in it.
    pub told: Vec<String>,
}

/// Leaves out of a story, which breaks a promise, whatever it breaks the same promise without.
#[must_use]
pub fn shrink(story: &Story, violation: &Violation, settings: &Settings) -> Shrunk {
    let mut runs = 0;
    let mut best = (story.clone(), violation.clone());
    let fails = |story: &Story, runs: &mut usize| {
        *runs += 1;
        run(story, settings).violation.filter(|found| found.promise == violation.promise)
    };
    loop {
        let mut smaller = simpler(&best.0, best.1.at).into_iter();
        let found = smaller.find_map(|story| {
            if runs >= MOST_RUNS || story == best.0 {
                return None;
            }
            fails(&story, &mut runs).map(|violation| (story, violation))
        });
        match found {
            Some(found) => best = found,
            None => break,
        }
    }
    let (story, violation) = best;
    let Outcome { told, .. } = run(&story, &settings.telling(TOLD));
    Shrunk { story, violation, told }
}

impl fmt::Display for Shrunk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.story)?;
        for line in &self.told {
            writeln!(f, "  {line}")?;
        }
        writeln!(f, "  {}", self.violation)
    }
}

/// Stories that are simpler by one thing, the greatest simplifications first. It broke at `broken`.
fn simpler(story: &Story, broken: Duration) -> Vec<Story> {
    let mut simpler = Vec::new();
    let mut with = |change: &dyn Fn(&mut Story)| {
        let mut changed = story.clone();
        change(&mut changed);
        simpler.push(changed);
    };
    with(&|story| story.faults.retain(|fault| fault.at() < broken));
    with(&|story| story.weather.retain(|weather| weather.from < broken));
    for node in (0..story.casts.len()).rev().filter(|_| story.casts.len() > 1) {
        with(&|story| without_node(story, node));
    }
    with(&|story| story.orders.retain(|order| order.at < broken));
    with(&|story| story.joint = false);
    for number in 0..story.orders.len() {
        with(&|story| drop(story.orders.remove(number)));
    }
    for number in 0..story.faults.len() {
        with(&|story| drop(story.faults.remove(number)));
    }
    with(&|story| story.weather.clear());
    for number in 0..story.weather.len() {
        with(&|story| {
            story.weather.remove(number);
        });
    }
    for (node, cast) in story.casts.iter().enumerate() {
        for number in 0..cast.roles.len() {
            with(&|story| drop(story.casts[node].roles.remove(number)));
        }
        with(&|story| story.casts[node].senses = None);
        with(&|story| story.casts[node].joins = Duration::ZERO);
        with(&|story| story.casts[node].history = Cast::ROOMY);
        with(&|story| story.casts[node].guarded = false);
        with(&|story| story.casts[node].grants = None);
        with(&|story| (story.casts[node].drift_ppm, story.casts[node].clock_offset) = (0, Duration::ZERO));
        with(&|story| story.casts[node].tick = Duration::from_millis(20));
    }
    for number in 0..story.weather.len() {
        let good = NetworkConfig::default();
        with(&|story| story.weather[number].habits.loss = good.loss);
        with(&|story| story.weather[number].habits.duplicate = good.duplicate);
        with(&|story| story.weather[number].habits.reorder = good.reorder);
        with(&|story| story.weather[number].habits.latency = good.latency);
    }
    simpler
}

fn without_node(story: &mut Story, gone: usize) {
    story.casts.remove(gone);
    let renumber = |node: usize| if node > gone { node - 1 } else { node };
    for fault in &mut story.faults {
        match fault {
            Fault::Partition { apart, .. } => {
                apart.retain(|node| *node != gone);
                apart.iter_mut().for_each(|node| *node = renumber(*node));
            }
            Fault::Pause { node, .. } | Fault::Restart { node, .. } => {
                // Number of nobody: the fault goes, below.
                *node = if *node == gone { usize::MAX } else { renumber(*node) };
            }
        }
    }
    for order in &mut story.orders {
        match &mut order.what {
            Ordered::Roster { coordinator, members, .. } => {
                members.retain(|node| *node != gone);
                members.iter_mut().for_each(|node| *node = renumber(*node));
                *coordinator = if *coordinator == gone { usize::MAX } else { renumber(*coordinator) };
            }
            Ordered::Lift { holder, .. } => {
                *holder = if *holder == gone { usize::MAX } else { renumber(*holder) };
            }
        }
    }
    story.orders.retain(|order| match &order.what {
        Ordered::Roster { coordinator: node, .. } | Ordered::Lift { holder: node, .. } => *node != usize::MAX,
    });
    story.faults.retain(|fault| match fault {
        Fault::Partition { apart, .. } => !apart.is_empty(),
        Fault::Pause { node, .. } | Fault::Restart { node, .. } => *node != usize::MAX,
    });
}

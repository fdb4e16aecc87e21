//! The mind of a vehicle: what decides on board.

use std::time::Duration;

use skein_bp::{Event, Program};
use skein_dbp::{Happened, Node};

use crate::bthreads;
use crate::config::AgentConfig;

/// Hears what the vehicle's body reports, and decides what is to be done. As given, the b-threads that it loads into
/// the node's program do so.
pub trait Mind: std::fmt::Debug + Send {
    /// Loads b-threads into the program of the vehicle's node.
    fn load(&self, program: &mut Program, config: &AgentConfig);

    fn hear(&mut self, now: Duration, report: Event, node: &mut Node) {
        let _ = now;
        node.enqueue(report);
    }

    /// Decides, once the node has made its step: what happens now, in this order.
    fn decide(&mut self, now: Duration, node: &mut Node) -> Vec<Happened> {
        let _ = now;
        node.take_selections()
    }
}

/// A vehicle's behavioural program.
#[derive(Clone, Copy, Debug, Default)]
pub struct BThreads;

impl Mind for BThreads {
    fn load(&self, program: &mut Program, config: &AgentConfig) {
        bthreads::load(program, config);
    }
}

//! The graph of a program's states, to be looked at or worked on by other tools.

use std::fmt::Write;
use std::sync::Arc;

use serde::Serialize;

use super::exploration::{Exploration, Limits};
use super::model::{Model, Moves};
use super::product::Product;
use super::report::{Inspection, Omission, Progress};
use crate::board::Owner;
use crate::event::Event;

/// The states that a program can reach, and the events that lead from one to another.
#[derive(Clone, Debug, Serialize)]
pub struct Graph {
    /// In the order in which the search found them; the first is the start.
    pub states: Vec<GraphState>,
    /// By the state they leave, then in a fixed order.
    pub edges: Vec<GraphEdge>,
    /// The missing parts.
    #[serde(skip)]
    pub not_covered: Vec<Omission>,
}

#[derive(Clone, Debug, Serialize)]
pub struct GraphState {
    /// The b-threads that run and the proxies, each with its state as JSON, or as text when that has no JSON form. A
    /// proxy's state is its bid.
    pub bthreads: Vec<(Arc<str>, serde_json::Value)>,
    /// The external queue.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub queue: Vec<Event>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hot: Vec<Arc<str>>,
    /// The failed assertion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub deadlock: bool,
}

/// One event that may be selected in a state.
#[derive(Clone, Debug, Serialize)]
pub struct GraphEdge {
    /// Number of the state in which it may.
    pub from: u32,
    pub event: Event,
    /// Number of the state after it.
    pub to: u32,
}

impl Graph {
    pub(super) fn of(product: &mut Product, limits: &Limits, progress: &mut dyn FnMut(&Progress)) -> Self {
        let mut seen = Exploration::new(product, limits);
        seen.run(product, &[], progress);
        let mut graph = Self { states: Vec::new(), edges: Vec::new(), not_covered: seen.take_not_covered() };
        let mut moves = Moves::default();
        for from in 0..seen.store.len() as u32 {
            let state = seen.store.state(from);
            moves.clear();
            product.expand(state, &mut moves);
            graph.states.push(GraphState::of(product, state, moves.is_empty()));
            graph.edges.extend(moves.iter().filter_map(|(label, target)| {
                let to = seen.store.find(target)?;
                Some(GraphEdge { from, event: product.event(label), to })
            }));
        }
        graph
    }

    /// The graph in the language of Graphviz. A double circle is a state that nothing leads out of; red is a failed
    /// assertion or a deadlock, orange a state in which someone is hot.
    pub fn to_dot(&self) -> String {
        let mut dot = String::from("digraph states {\n  node [shape=circle];\n");
        let mut is_left = vec![false; self.states.len()];
        for edge in &self.edges {
            if let Some(left) = is_left.get_mut(edge.from as usize) {
                *left = true;
            }
        }
        for ((number, state), left) in self.states.iter().enumerate().zip(is_left) {
            let colour = match state {
                GraphState { failure: Some(_), .. } | GraphState { deadlock: true, .. } => ", color=red",
                GraphState { hot, .. } if !hot.is_empty() => ", color=orange",
                _ => "",
            };
            let shape = if left { "" } else { ", shape=doublecircle" };
            // Writing to a text cannot fail.
            let _ = writeln!(dot, "  {number} [tooltip={}{shape}{colour}];", quoted(&state.to_string()));
        }
        for GraphEdge { from, event, to } in &self.edges {
            let _ = writeln!(dot, "  {from} -> {to} [label={}];", quoted(&event.to_string()));
        }
        dot.push_str("}\n");
        dot
    }

    /// The graph as JSON: `{"states": [..], "edges": [{"from": 0, "event": .., "to": 1}, ..]}`, with events written as
    /// in [`crate::notation`].
    ///
    /// # Errors
    /// When an event's data has no JSON form, such as a key that is not a text.
    pub fn to_json(&self) -> Result<serde_json::Value, serde_json::Error> {
        serde_json::to_value(self)
    }
}

impl GraphState {
    fn of(product: &Product, state: &[u32], stuck: bool) -> Self {
        let of_owner = |owner: &Owner, bid| match owner {
            Owner::BThread(bthread) => bthread.to_json().unwrap_or_else(|_| format!("{bthread:?}").into()),
            Owner::Proxy => serde_json::to_value(bid).unwrap_or_else(|_| format!("{bid:?}").into()),
        };
        let locals = product.locals.of(state);
        let hot = product.locals.of(state).filter(|local| local.bid.is_hot());
        Self {
            bthreads: locals.map(|local| (local.name.clone(), of_owner(&local.owner, &local.bid))).collect(),
            queue: product.view(state).external_queue().cloned().collect(),
            hot: hot.map(|local| local.name.clone()).collect(),
            failure: product.failure(state).map(|(bthread, message)| format!("{bthread}: {message}")),
            deadlock: product.fault(state, stuck, &[Inspection::Deadlock]).is_some(),
        }
    }
}

impl std::fmt::Display for GraphState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(failure) = &self.failure {
            writeln!(f, "{failure}")?;
        }
        for (name, state) in &self.bthreads {
            writeln!(f, "{name}: {state}")?;
        }
        self.queue.iter().try_for_each(|event| writeln!(f, "queued: {event}"))
    }
}

/// A text as Graphviz reads it.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.trim_end().replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n"))
}

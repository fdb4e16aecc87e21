//! The events that a b-thread waits for, in words.

use skein_bp::EventSet;
use skein_dbp::facts::Confirmed;
use skein_dbp::{NodeName, first_two_chunks};
use skein_wire::event::{Declared as _, HandBack, OrderGiven, OrderTaken, What};

/// Alternatives that are told one by one.
const MOST_TOLD: usize = 6;
/// The orders that may free a b-thread, as the console's buttons name them.
const ORDERS: [(What, &str); 6] = [
    (What::Resume, "Resume"),
    (What::Return, "Return"),
    (What::Land, "Land"),
    (What::GoTo, "Go to"),
    (What::Launch, "Launch"),
    (What::HandBack, "Hand back"),
];

/// The ways for a b-thread that waits for `set` to go on; nobody requests any of it.
pub(super) fn in_words(set: &EventSet, vehicle: &NodeName) -> Vec<String> {
    let mut alternatives = Vec::new();
    split(set, &mut alternatives);
    let (mut orders, mut others, mut confirmations) = (Vec::new(), Vec::new(), Vec::new());
    for alternative in alternatives {
        let heard = orders_in(alternative, vehicle);
        if heard.is_empty() {
            match confirmed_at(alternative) {
                Some(node) => confirmations.push(node),
                None => others.push(format!("`{alternative}`")),
            }
        }
        orders.extend(heard);
    }
    let mut words = Vec::new();
    let names = ORDERS.iter().filter(|(what, _)| orders.contains(what)).map(|(_, name)| *name);
    let names: Vec<&str> = names.collect();
    if !names.is_empty() {
        words.push(format!("the operator orders {}", either(&names)));
    }
    words.extend(confirmations.iter().map(|node| format!("every node confirms the block of {node}")));
    let more = others.len().saturating_sub(MOST_TOLD);
    others.truncate(MOST_TOLD);
    if more > 0 {
        others.push(format!("{more} more"));
    }
    if !others.is_empty() {
        let others: Vec<&str> = others.iter().map(String::as_str).collect();
        words.push(format!("{} happens, which nobody requests", either(&others)));
    }
    words
}

/// `a, b or c`.
fn either(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [only] => (*only).to_owned(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

/// The sets of which `set` is the union.
fn split<'a>(set: &'a EventSet, into: &mut Vec<&'a EventSet>) {
    match set {
        EventSet::Or(sets) => sets.iter().for_each(|set| split(set, into)),
        EventSet::None => {}
        set => into.push(set),
    }
}

/// Which orders of an operator are in the set, be it at the station or as they reach a vehicle.
fn orders_in(set: &EventSet, vehicle: &NodeName) -> Vec<What> {
    let Some(name) = literal_name(set) else { return Vec::new() };
    let Some(node) = first_two_chunks(name) else { return Vec::new() };
    let kind = name.rsplit('/').next();
    let contains = |what: What| match kind {
        Some(OrderGiven::NAME) => [OrderGiven::ALL, vehicle.as_str()]
            .iter()
            .any(|who| set.contains(&OrderGiven::plain(what, who, "").at(node))),
        Some(OrderTaken::NAME) => set.contains(&OrderTaken::plain(what, "").at(node)),
        // Only an operator hands back.
        Some(HandBack::NAME) => what == What::HandBack && set.contains(&HandBack.at(node)),
        _ => false,
    };
    // Many wait for a hold, and it frees nobody.
    ORDERS.iter().map(|(what, _)| *what).chain([What::Hold]).filter(|what| contains(*what)).collect()
}

/// The node whose blocks are to be confirmed, if that is what the set is about.
fn confirmed_at(set: &EventSet) -> Option<&str> {
    let (node, kind) = literal_name(set)?.rsplit_once('/')?;
    (kind == Confirmed::NAME).then_some(node)
}

fn literal_name(set: &EventSet) -> Option<&str> {
    match set {
        EventSet::Named(name) if name.is_literal() => Some(name.as_str()),
        EventSet::Exactly(event) => Some(event.name()),
        EventSet::And(sets) => sets.iter().find_map(literal_name),
        _ => None,
    }
}

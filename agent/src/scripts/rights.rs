//! What a script may ask for and forbid, and whether it knows what it speaks of.

use skein_bp::script::Script;
use skein_bp::{Bid, Event, EventSet, Pattern};
use skein_dbp::{Grant, NodeName, facts};
use skein_wire::vocabulary::{ADVANCE, GOTO, ORDER, TAKEOFF, verbs};

use crate::bthreads::HOME_LEG;
use crate::me::Me;

/// The orders that a script may give at its vehicle's own gateway.
const ORDERS: [&str; 5] = ["goto", "hold", "resume", "return", "land"];

/// What scripts may do on a vehicle.
#[derive(Clone, Debug)]
pub struct ScriptRights {
    me: Me,
    /// The nodes of the fleet.
    nodes: Vec<NodeName>,
    grant: Grant,
}

impl ScriptRights {
    /// What every script may do: order its own vehicle about at its gateway, hold it, and have events of its own. It cannot
    /// keep a vehicle from the way home, from landing, or from anything else that is for its safety.
    #[must_use]
    pub fn usual(me: &Me, roster: &[String]) -> Self {
        let own = EventSet::prefix(own_events(me));
        let orders = EventSet::any_of(ORDERS.map(|what| EventSet::field_is("what", what)));
        let away = me.any(GOTO).and(EventSet::field_is("leg", HOME_LEG).not());
        Self {
            nodes: roster.iter().filter_map(|node| NodeName::new(node).ok()).collect(),
            grant: Grant {
                request: me.any(ORDER).and(orders).or(own.clone()),
                block: me.any_of(&[ADVANCE, TAKEOFF]).or(away).or(own),
            },
            me: me.clone(),
        }
    }

    /// What may be blocked.
    #[must_use]
    pub fn block(&self) -> &EventSet {
        &self.grant.block
    }

    /// Whether a script keeps to its rights, and speaks of events that there are.
    ///
    /// # Errors
    /// The first thing that it may not, or that nobody knows.
    pub fn check(&self, script: &Script) -> Result<(), String> {
        script.bids().try_for_each(|bid| self.check_bid(bid))
    }

    fn check_bid(&self, bid: &Bid) -> Result<(), String> {
        for request in bid.requests() {
            self.check_request(request)?;
        }
        for (verb, set) in
            [("waits for", bid.waits()), ("blocks", bid.blocks()), ("is ended by", bid.interrupts())]
        {
            self.check_names(set).map_err(|stranger| {
                format!("it {verb} `{stranger}`, and there is no such event in this fleet")
            })?;
        }
        self.check_blocks(bid.blocks())
    }

    fn check_request(&self, request: &Event) -> Result<(), String> {
        if self.grant.request.contains(request) {
            return Ok(());
        }
        let gateway = self.me.event(ORDER);
        Err(format!(
            "it requests `{request}`, which scripts may not; they may request `{gateway}` with `what` one of {}, and \
             `{}...`",
            ORDERS.join(", "),
            own_events(&self.me)
        ))
    }

    fn check_blocks(&self, blocks: &EventSet) -> Result<(), String> {
        let forbidden = |name: &String| blocks.may_hold_named(name) && !self.grant.block.may_hold_named(name);
        if let Some(name) = self.own_names().find(forbidden) {
            return Err(format!("it blocks `{name}`, which scripts may not"));
        }
        let elsewhere = self
            .nodes
            .iter()
            .find(|node| node.as_str() != self.me.name() && blocks.could_match_home(node.as_str()));
        match elsewhere {
            Some(node) => {
                Err(format!("it blocks events of {node}; scripts may block only their own vehicle's"))
            }
            None => Ok(()),
        }
    }

    /// The names of the vehicle's own events, but for those that its scripts make up.
    fn own_names(&self) -> impl Iterator<Item = String> {
        let name = NodeName::new(self.me.name()).ok();
        let told = name.into_iter().flat_map(|name| facts::names().map(move |fact| name.event_name(fact)));
        verbs().map(|verb| self.me.event(verb).name().to_owned()).chain(told)
    }

    /// Checks that each name in a set is that of an event, and each pattern fits one.
    ///
    /// # Errors
    /// The first that does not.
    fn check_names(&self, set: &EventSet) -> Result<(), String> {
        match set {
            EventSet::Exactly(event) => self.check_name(event.name()),
            EventSet::Named(pattern) if pattern.is_literal() => self.check_name(pattern.as_str()),
            EventSet::Named(pattern) => self.check_pattern(pattern),
            EventSet::Not(set) => self.check_names(set),
            EventSet::And(sets) | EventSet::Or(sets) => sets.iter().try_for_each(|set| self.check_names(set)),
            EventSet::Prefix(prefix)
                if !self.nodes.iter().any(|node| set.could_match_home(node.as_str())) =>
            {
                Err(format!("{prefix}.."))
            }
            _ => Ok(()),
        }
    }

    fn check_name(&self, name: &str) -> Result<(), String> {
        let node = self.nodes.iter().find_map(|node| {
            let verb = name.strip_prefix(node.as_str())?.strip_prefix('/')?;
            Some((node, verb))
        });
        let known = node.is_some_and(|(node, verb)| {
            // What other nodes than vehicles say is their own affair.
            !node.as_str().starts_with("uav/")
                || verb.starts_with("script/")
                || verbs().chain(facts::names()).any(|known| known == verb)
        });
        if known { Ok(()) } else { Err(name.to_owned()) }
    }

    fn check_pattern(&self, pattern: &Pattern) -> Result<(), String> {
        let set = EventSet::Named(pattern.clone());
        let fits = |node: &NodeName| {
            let of_vehicle =
                verbs().chain(facts::names()).any(|verb| pattern.matches(&node.event_name(verb)));
            of_vehicle || !node.as_str().starts_with("uav/") && set.could_match_home(node.as_str())
        };
        if self.nodes.iter().any(fits) { Ok(()) } else { Err(pattern.as_str().to_owned()) }
    }
}

/// How the names of the events begin that a vehicle's scripts make up.
fn own_events(me: &Me) -> String {
    format!("{}/script/", me.name())
}

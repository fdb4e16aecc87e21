//! The rights of a script to ask and to forbid, and whether it knows what it speaks of.

use skein_bp::script::Script;
use skein_bp::{Bid, Event, EventSet};
use skein_dbp::Grant;
use skein_wire::event::{Advance, Catalogue, Declared as _, Goto, Limit, OrderTaken, Takeoff, What};

use crate::bthreads::HOME_LEG;
use crate::me::Me;
use crate::scripts::vocabulary::Vocabulary;

/// The rights of scripts on a vehicle.
#[derive(Clone, Debug)]
pub struct ScriptRights {
    me: Me,
    vocabulary: Vocabulary,
    grant: Grant,
}

impl ScriptRights {
    /// The rights of every script: order its own vehicle about at its gateway, hold it, limit its motion, and have
    /// events of its own. It
    /// cannot keep a vehicle from the way home, from landing, or from anything else that is for its safety.
    pub fn usual(me: &Me, roster: &[String], events: &Catalogue) -> Self {
        let own = EventSet::prefix(own_events(me));
        let orders = EventSet::any_of(What::those(What::is_open_to_scripts).map(OrderTaken::what));
        let away = me.any::<Goto>().and(Goto::leg(HOME_LEG).not());
        Self {
            vocabulary: Vocabulary::new(roster, events),
            grant: Grant {
                request: me.any::<OrderTaken>().and(orders).or(own.clone()),
                block: me.any::<(Advance, Takeoff)>().or(away).or(own),
            },
            me: me.clone(),
        }
    }

    pub fn block(&self) -> &EventSet {
        &self.grant.block
    }

    /// Whether a script keeps to its rights, and speaks of events that there are.
    pub fn check(&self, script: &Script) -> Result<(), String> {
        script.bids().try_for_each(|bid| self.check_bid(bid))
    }

    fn check_bid(&self, bid: &Bid) -> Result<(), String> {
        for request in bid.requests() {
            self.check_request(request)?;
        }
        for stated in bid.stated() {
            self.check_stated(stated)?;
        }
        self.check_blocks(bid.blocks())?;
        for (verb, set) in
            [("waits for", bid.waits()), ("blocks", bid.blocks()), ("is ended by", bid.interrupts())]
        {
            self.vocabulary.check(set).map_err(|fault| format!("it {verb} {fault}"))?;
        }
        Ok(())
    }

    fn check_request(&self, request: &Event) -> Result<(), String> {
        if self.grant.request.contains(request) {
            return self.vocabulary.check_event(request).map_err(|fault| format!("it requests {fault}"));
        }
        let gateway = self.me.event_name(OrderTaken::NAME);
        let orders: Vec<_> = What::those(What::is_open_to_scripts).map(What::word).collect();
        Err(format!(
            "it requests `{request}`, which scripts may not; they may request `{gateway}` with `what` one of {}, and \
             `{}...`",
            orders.join(", "),
            own_events(&self.me)
        ))
    }

    fn check_stated(&self, stated: &Event) -> Result<(), String> {
        if !self.me.heard::<Limit>(stated) {
            let limit = self.me.event_name(Limit::NAME);
            return Err(format!("it states `{}`; scripts may state nothing but `{limit}`", stated.name()));
        }
        if stated.data().len() == 0 {
            return Err(format!("it states `{}` without a bound", stated.name()));
        }
        self.vocabulary.check_event(stated).map_err(|fault| format!("it states {fault}"))
    }

    fn check_blocks(&self, blocks: &EventSet) -> Result<(), String> {
        let forbidden = |name: &String| blocks.may_hold_named(name) && !self.grant.block.may_hold_named(name);
        if let Some(name) = self.vocabulary.names(&self.me).find(forbidden) {
            return Err(format!("it blocks `{name}`, which scripts may not"));
        }
        let elsewhere = self
            .vocabulary
            .nodes()
            .iter()
            .find(|node| node.as_str() != self.me.name() && blocks.could_match_home(node.as_str()));
        match elsewhere {
            Some(node) => {
                Err(format!("it blocks events of {node}; scripts may block only their own vehicle's"))
            }
            None => Ok(()),
        }
    }
}

/// The prefix of the events that a vehicle's scripts make up.
fn own_events(me: &Me) -> String {
    format!("{}/script/", me.name())
}

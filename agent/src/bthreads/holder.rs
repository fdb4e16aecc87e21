//! Holder: whose orders the vehicle takes. One person or program holds it; the fact stands here, for all stations.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_wire::event::{Handover, Held, Load, OrderTaken, Unload, What};

use crate::{me::Me, precedence};

/// A holder of whom nothing is heard for so long does not hold the vehicle any more.
pub const HOLDING_LASTS: Duration = Duration::from_secs(30);
/// The longest name of a person or program, in bytes.
pub const LONGEST_NAME: usize = 64;

/// Blocks the orders of others while somebody holds the vehicle. Orders for its safety (hold, return, land) are
/// anybody's who has the right, and so are those given aboard.
///
/// Whoever gives an order that needs the vehicle holds it from then on, if nobody does.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Holder {
    me: Me,
    holder: Option<String>,
    /// Until when the holder is heard of again, if there is one.
    until: Duration,
    asked_by: Option<String>,
    /// Why what was told last is not so any more.
    news: Option<String>,
}

impl Holder {
    /// The name that this b-thread runs under: whoever tells the vehicle's state asks it by name.
    pub const NAME: &'static str = "holder";

    pub fn new(me: Me) -> Self {
        Self { me, holder: None, until: Duration::ZERO, asked_by: None, news: None }
    }

    /// The person or program that holds the vehicle, if one does.
    pub fn holder(&self) -> Option<&str> {
        self.holder.as_deref()
    }

    /// The person who asks the holder for it.
    pub fn asked_by(&self) -> Option<&str> {
        self.asked_by.as_deref()
    }

    fn orders_of_others(&self, holder: &str) -> EventSet {
        let needing = EventSet::any_of(What::those(What::needs_holder).map(OrderTaken::what));
        let from_afar = OrderTaken::aboard(true).not().and(OrderTaken::by(holder).not());
        let orders = self.me.any::<OrderTaken>().and(needing).and(from_afar);
        orders.or(self.me.any::<(Load, Unload)>().and(Load::by(holder).not()))
    }

    fn held(&self, why: &str) -> Event {
        let name = |name: &Option<String>| name.as_deref().map(Into::into);
        self.me.event(Held { by: name(&self.holder), asked_by: name(&self.asked_by), why: why.into() })
    }

    fn pass_to(&mut self, holder: Option<String>, now: Duration, why: String) {
        self.asked_by.take_if(|asking| holder.is_none() || holder.as_ref() == Some(asking));
        (self.holder, self.until, self.news) = (holder, now + HOLDING_LASTS, Some(why));
    }

    /// Whoever holds it lets it go: whoever asks for it holds it then.
    fn let_go(&mut self, now: Duration, why: String) {
        let next = self.asked_by.take();
        self.pass_to(next, now, why);
    }

    /// `by` is there, and would hold the vehicle if nobody did.
    fn keep(&mut self, by: &str, now: Duration) {
        match self.holder.as_deref() {
            None => self.pass_to(Some(by.to_owned()), now, "nobody held it".to_owned()),
            Some(holder) if holder == by => self.until = now + HOLDING_LASTS,
            Some(_) => {}
        }
    }

    fn hand_over(&mut self, Handover { what, by, to }: &Handover, now: Duration) {
        let is_holder = self.holder.as_deref() == Some(&**by);
        match (what, to) {
            (What::Take, _) if !is_holder => {
                let from = self.holder.as_deref().map_or("nobody".to_owned(), str::to_owned);
                self.pass_to(Some(by.to_string()), now, format!("{by} has taken it from {from}"));
            }
            (What::Ask, _) if self.holder.is_some() && !is_holder => {
                self.asked_by = Some(by.to_string());
                self.news = Some(format!("{by} asks for it"));
            }
            (What::Give, Some(to)) if is_holder && is_name(to) => {
                self.pass_to(Some(to.to_string()), now, format!("{by} has given it"));
            }
            (What::Release, _) if is_holder => self.let_go(now, format!("{by} has let it go")),
            (What::Take | What::Ask | What::Keep, _) => self.keep(by, now),
            _ => {}
        }
    }

    /// The person or program whose order needs the vehicle, if it is one.
    fn orderer(&self, event: &Event) -> Option<String> {
        let order = self.me.read::<OrderTaken>(event);
        let order = order.filter(|order| order.what.needs_holder() && order.aboard != Some(true));
        let load = || self.me.read::<Load>(event)?.by;
        let unload = || self.me.read::<Unload>(event)?.by;
        let by = order.map(|order| order.by).or_else(load).or_else(unload)?;
        is_name(&by).then(|| by.to_string())
    }
}

fn is_name(name: &str) -> bool {
    !name.is_empty() && name.len() <= LONGEST_NAME
}

impl BThread for Holder {
    fn bid(&self) -> Option<Bid> {
        let heard = self.me.any::<(OrderTaken, Handover, Load, Unload)>();
        let mut bid = Bid::new().priority(precedence::LINK).wait_for(heard);
        if let Some(why) = &self.news {
            bid = bid.request(self.held(why));
        }
        Some(match &self.holder {
            Some(holder) => bid.block(self.orders_of_others(holder)).deadline(self.until),
            None => bid,
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let now = cx.now();
        if self.me.heard::<Held>(event) {
            self.news = None;
        } else if let Some(handover) = self.me.read::<Handover>(event) {
            if is_name(&handover.by) {
                self.hand_over(&handover, now);
            }
        } else if let Some(by) = self.orderer(event) {
            self.keep(&by, now);
        } else if self.holder.is_some() && now >= self.until {
            let gone = self.holder.take().unwrap_or_default();
            let silent = HOLDING_LASTS.as_secs();
            self.let_go(now, format!("{gone} was not heard of for {silent} s"));
        }
    }
}

//! Right of way: where there is room for one, whoever may be there is agreed on, wherever the others' programs run.
//!
//! Before the vehicle flies into a narrow stretch of its way, it blocks `enter` for everyone else who would go against
//! it there or across, awaits confirmation from every home, and only then requests its own `enter` for each place of
//! the stretch (*block, await confirmation, act*). Those who go the same way are not kept out. As the way unfolds the
//! stretch grows, and is claimed anew; what lies behind is let go. Nothing but this block keeps the others out.
//!
//! Two that claim at once block each other; the one with the higher number then gives way. Who waits withdraws its
//! claim now and then, and all that it has entered but where it is, so that whoever is further in gets on with its own.
//!
//! Vehicles may meet inside, where neither could know of the other. Who stands in the way of one that goes before it
//! makes way: see [`Right`]. If it cannot, it is cornered, and goes first.
//!
//! A vehicle that is lost confirms nothing, and must not close every passage for ever. It is done without while most of
//! the fleet is in reach, unless it had a claim to this very stretch when it was lost: to claim another since, it would
//! have needed the confirmation of those who have lost it. So on a cut network one side at most goes on, and whoever
//! was inside is waited for: after half a minute a way around where it was lost is looked for, and at last the vehicle
//! lands and says for whom it waited. Whoever has just heard another again first lets claims cross, for as long as it
//! takes to repeat them.
//!
//! Where radio is known to be short, silence is distance: whoever is not heard is so far away that it cannot be at a
//! place within half the range before that is let go, and is done without.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::facts::{BlockLapsed, Confirmed, PeerJoined, PeerLost, Stalled};
use skein_wire::event::{
    Advance, Cornered, Declared as _, Enter, GiveWay, Homeward, InTheWay, Land, Landed, Leave, MakeWay,
    OutOfTheWay, Passage, Plan, PlanReason, Right, of, of_every_vehicle,
};

use crate::{me::Me, precedence, rank::goes_before, stretch::Stretch};

/// The name under which this b-thread runs, as confirmations name it.
pub const NAME: &str = "right_of_way";
/// A vehicle that gave way claims again when it hears that another has left a passage, or after this long.
const PATIENCE: Duration = Duration::from_secs(2);
/// One that waits for others claims no longer than this at a time, outside and inside.
const INSISTS_FOR: Duration = Duration::from_secs(3);
const INSISTS_INSIDE_FOR: Duration = Duration::from_secs(10);
/// One that waits so long for another that was lost in the stretch ahead looks for another way.
const LOST_PATIENCE: Duration = Duration::from_secs(30);
/// So often it looks before it lands.
const LOOKS: u8 = 4;
/// A vehicle without leave to move stands after this.
const STOPS_WITHIN: Duration = Duration::from_secs(2);
/// Claims that were made apart are known to both sides so many leases after they have met again: records are repeated
/// every tenth of one.
const MEETING_LEASES: f64 = 1.5;

/// Claims narrow stretches, enters them when the claim is confirmed, lets go behind, and makes way.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct RightOfWay {
    me: Me,
    /// The other vehicles and the ground station.
    others: BTreeMap<String, Other>,
    /// Their last word of those of them that have a narrow stretch before them.
    told: BTreeMap<String, Told>,
    /// Silence of another means that it is out of range.
    radio_is_short: bool,
    /// The time that claims take to cross.
    meeting: Duration,
    /// No claim counts before this.
    met: Duration,
    /// The stretch that it has entered, place by place, or where it is.
    held: Stretch,
    /// The stretch of its way that lies ahead, with that part of it in which it is.
    ahead: Stretch,
    /// It could not make way, and has not come out since.
    cornered: bool,
    /// It has looked so often for a way around one that is lost.
    looked: u8,
    phase: Phase,
}

/// The knowledge of another node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Other {
    /// Not heard yet: it cannot have claimed anything.
    Unheard,
    Alive,
    /// Lost without a claim.
    Lost,
    /// Lost with a claim: it may be in a passage.
    LostClaiming,
}

/// The word of another vehicle: its right to go first, and the stretch of its way.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize)]
struct Told {
    right: Right,
    stretch: Stretch,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    /// It may fly on: nothing narrow lies ahead that it has not entered.
    Clear,
    /// It awaits confirmation; `until` is when it looks for another way, if one was lost in the stretch.
    Claiming {
        until: Option<Duration>,
    },
    /// It looks for a way around one that is lost.
    LookingElsewhere,
    /// It has found none.
    GivingUp {
        lost: String,
    },
    /// `next` is the place to enter next; who is outside insists until then.
    Entering {
        next: usize,
        until: Duration,
    },
    /// It stands, and lets go what it has entered, but where it is.
    GivingWay,
    Yielding {
        until: Duration,
    },
    /// It is to make way for another, and control has not been told.
    Asked {
        of: String,
    },
    MakingWay,
}

impl RightOfWay {
    /// The b-thread of vehicle `me`; `others` are the other vehicles and the ground station, `lease` is that of their
    /// bids.
    pub fn new<'a>(me: Me, others: impl IntoIterator<Item = &'a str>, lease: Duration) -> Self {
        let others = others.into_iter().map(|node| (node.to_owned(), Other::Unheard)).collect();
        let meeting = lease.mul_f64(MEETING_LEASES);
        let (held, ahead, told) = (Stretch::default(), Stretch::default(), BTreeMap::new());
        Self {
            me,
            others,
            told,
            radio_is_short: false,
            meeting,
            met: Duration::ZERO,
            held,
            ahead,
            cornered: false,
            looked: 0,
            phase: Phase::Clear,
        }
    }

    /// The same in a fleet whose radios do not reach everywhere.
    #[must_use]
    pub fn with_short_radio(self, radio_is_short: bool) -> Self {
        Self { radio_is_short, ..self }
    }

    /// Its right to go first.
    pub fn right(&self) -> Right {
        match (self.cornered, self.held.here().is_empty()) {
            (true, _) => Right::Cornered,
            (false, false) => Right::Inside,
            (false, true) => Right::Free,
        }
    }

    /// `enter` of everyone else, against a stretch.
    fn of_everyone(&self, against: EventSet) -> EventSet {
        of_every_vehicle::<Enter>().and(self.me.any::<Enter>().not()).and(against)
    }

    /// `enter` against what it is in and what lies ahead, of those whose confirmation is needed.
    fn claim(&self) -> EventSet {
        let against = self.held.against().or(self.ahead.against());
        let alive = 1 + self.others.values().filter(|other| **other == Other::Alive).count();
        if !self.radio_is_short && 2 * alive <= self.others.len() + 1 {
            return self.of_everyone(against);
        }
        let needed = self.others.iter().filter(|(node, other)| match other {
            Other::Alive => true,
            Other::LostClaiming => !self.radio_is_short && self.may_hold(node),
            Other::Unheard | Other::Lost => false,
        });
        EventSet::any_of(needed.map(|(node, _)| of::<Enter>(node))).and(against)
    }

    /// One that was lost with a claim to what lies ahead.
    fn lost_ahead(&self) -> Option<&str> {
        let is_there = |(node, other): &(&String, &Other)| {
            **other == Other::LostClaiming && !self.radio_is_short && self.may_hold(node)
        };
        self.others.iter().find(is_there).map(|(node, _)| node.as_str())
    }

    /// Claims what lies ahead.
    fn claim_now(&self, now: Duration) -> Phase {
        Phase::Claiming { until: self.lost_ahead().map(|_| now + LOST_PATIENCE) }
    }

    /// It has waited for one that is lost.
    fn look_elsewhere(&mut self, now: Duration) -> Phase {
        let Some(lost) = self.lost_ahead().map(str::to_owned) else { return self.claim_now(now) };
        self.looked += 1;
        if self.looked > LOOKS { Phase::GivingUp { lost } } else { Phase::LookingElsewhere }
    }

    /// Whether another that was lost with a claim may be in the stretch ahead: its claim was for what it told last.
    fn may_hold(&self, node: &str) -> bool {
        let told = self.told.get(node).filter(|told| !told.stretch.is_empty());
        told.is_none_or(|told| self.ahead.leads_against(&told.stretch, &self.me))
    }

    /// The fate of its claim on the place with number `next`, which it insists on until then, now that another
    /// vehicle's is in its way: if that goes before it, who has entered nothing withdraws its claim at once, and who
    /// has, when it stands.
    fn stand_against(&mut self, stalled: &Stalled, (next, until): (usize, Duration), now: Duration) -> Phase {
        // Facts name a remote b-thread `node#bthread`.
        let node = stalled.by.split('#').next().unwrap_or_default();
        let its_right = self.told.get(node).map_or(Right::Free, |told| told.right);
        let gives_in = stalled.event.ends_with(Enter::NAME)
            && goes_before((node, its_right), (self.me.name(), self.right()));
        match (gives_in, self.held.is_entered()) {
            (true, false) => self.give_in(now),
            (true, true) => Phase::Entering { next, until: until.min(now + STOPS_WITHIN) },
            (false, _) => Phase::Entering { next, until },
        }
    }

    /// Keeps as its own the part of a stretch that it has entered, though it does not go on entering it now.
    fn keep_entered(&mut self) {
        if let Phase::Entering { next, .. } = self.phase {
            self.held = self.held.and_first(next, &self.ahead);
        }
    }

    /// Withdraws its claim for a while, with all that it has entered.
    fn give_in(&mut self, now: Duration) -> Phase {
        self.keep_entered();
        if self.held.is_entered() { Phase::GivingWay } else { Phase::Yielding { until: now + PATIENCE } }
    }

    /// Takes in that another node is heard or lost.
    fn note(&mut self, event: &Event, now: Duration) {
        let (node, now_it_is) = if let Some(joined) = PeerJoined::read(event) {
            (joined.node, Other::Alive)
        } else if let Some(lost) = PeerLost::read(event) {
            let claimed = lost.released.split(' ').any(|bthread| bthread == NAME);
            (lost.node, if claimed { Other::LostClaiming } else { Other::Lost })
        } else {
            return;
        };
        let Some(other) = self.others.get_mut(node.as_str()) else { return };
        *other = now_it_is;
        if now_it_is == Other::Alive {
            self.met = now + self.meeting;
        }
    }

    /// Its next state where nobody is made way for: what lies ahead is claimed unless it is entered already; where
    /// two sides have just met, a little later.
    fn go_on(&mut self, now: Duration) -> Phase {
        if self.ahead.is_part_of(&self.held) {
            self.held = self.ahead.clone();
            Phase::Clear
        } else if now < self.met {
            Phase::Yielding { until: self.met }
        } else {
            self.claim_now(now)
        }
    }

    /// Enters the next place, from that number on, in which it is not yet.
    fn enter_from(&mut self, index: usize, until: Duration) -> Phase {
        match self.ahead.first_outside(&self.held, index) {
            Some(next) => Phase::Entering { next, until },
            None => {
                self.held = self.ahead.clone();
                Phase::Clear
            }
        }
    }

    /// Takes in what lies ahead now.
    fn look_ahead(&mut self, stretch: Stretch, now: Duration) -> Phase {
        self.keep_entered();
        self.ahead = stretch;
        self.held = self.held.at(&self.ahead);
        match &self.phase {
            Phase::Yielding { until } if !self.ahead.is_part_of(&self.held) => {
                Phase::Yielding { until: *until }
            }
            phase @ (Phase::MakingWay | Phase::Asked { .. }) => phase.clone(),
            _ => self.go_on(now),
        }
    }

    /// Takes in what right another vehicle has, and tries again at once if one has left.
    fn hear_other(&mut self, event: &Event, now: Duration) -> Option<Phase> {
        let (node, verb) =
            event.name().rsplit_once('/').filter(|(node, _)| self.others.contains_key(*node))?;
        match (verb, Stretch::read(event)) {
            (Cornered::NAME, _) => self.told.entry(node.to_owned()).or_default().right = Right::Cornered,
            (_, Some(stretch)) => {
                let told = self.told.entry(node.to_owned()).or_default();
                told.right = match told.right {
                    Right::Cornered => Right::Cornered,
                    _ if stretch.here().is_empty() => Right::Free,
                    _ => Right::Inside,
                };
                told.stretch = stretch;
            }
            _ => drop(self.told.remove(node)),
        }
        Some(match self.phase {
            Phase::Yielding { .. } if verb == Leave::NAME => self.go_on(now),
            _ => self.phase.clone(),
        })
    }

    /// Its phase, if it keeps nobody in. Who has entered what another is in, that goes before it and came there without
    /// having been asked, stands and lets go all but where it is: else neither gets on. One that is out of range is not
    /// there as far as can be known: of that, it might never hear the end.
    fn let_out(&self, phase: Phase, now: Duration) -> Phase {
        let is_there = |node: &str| {
            let is_lost = matches!(self.others.get(node), Some(Other::Lost | Other::LostClaiming));
            !(self.radio_is_short && is_lost)
        };
        let keeps_in = |(node, told): (&String, &Told)| {
            is_there(node)
                && goes_before((node, told.right), (self.me.name(), self.right()))
                && self.held.leads_against(&told.stretch.here(), &self.me)
        };
        if phase == Phase::Clear && self.held.is_entered() && self.told.iter().any(keeps_in) {
            Phase::Entering { next: self.ahead.len(), until: now + STOPS_WITHIN }
        } else {
            phase
        }
    }

    /// Its change as a whole: what is ahead, whether it is made way for, whether it is out.
    fn hear(&mut self, event: &Event, now: Duration) -> Option<Phase> {
        if let Some(phase) = self.hear_other(event, now) {
            return Some(phase);
        }
        let me = &self.me;
        if let Some(stretch) = Stretch::read(event).filter(|_| me.heard::<Passage>(event)) {
            return Some(self.look_ahead(stretch, now));
        }
        if let Some(InTheWay { of, right }) = me.read(event) {
            if !goes_before((&of, right), (me.name(), self.right())) {
                return None;
            }
            self.keep_entered();
            return Some(Phase::Asked { of: of.to_string() });
        }
        match me.verb(event)? {
            Leave::NAME | Landed::NAME => {
                (self.held, self.ahead, self.cornered) = (Stretch::default(), Stretch::default(), false);
                let makes_way = matches!(self.phase, Phase::Asked { .. } | Phase::MakingWay);
                Some(if makes_way && me.heard::<Leave>(event) { self.phase.clone() } else { Phase::Clear })
            }
            MakeWay::NAME => Some(Phase::MakingWay),
            Cornered::NAME => {
                self.cornered = true;
                Some(self.go_on(now))
            }
            OutOfTheWay::NAME => Some(self.go_on(now)),
            PeerJoined::NAME | PeerLost::NAME => {
                self.note(event, now);
                self.keep_entered();
                let claims = matches!(self.phase, Phase::Claiming { .. } | Phase::Entering { .. });
                Some(if claims { self.go_on(now) } else { self.phase.clone() })
            }
            _ => None,
        }
    }

    /// Its next phase by what happens to its claim.
    fn go_through(&mut self, event: &Event, now: Duration) -> Phase {
        let confirmed = Confirmed::read(event).is_some_and(|fact| &*fact.bthread == NAME);
        let lapsed = BlockLapsed::read(event).is_some_and(|fact| &*fact.bthread == NAME);
        match (self.phase.clone(), self.me.verb(event)) {
            (Phase::Claiming { .. }, _) if confirmed => {
                self.looked = 0;
                let is_inside = self.right() != Right::Free;
                self.enter_from(0, now + if is_inside { INSISTS_INSIDE_FOR } else { INSISTS_FOR })
            }
            (Phase::Entering { next, until }, Some(Enter::NAME)) => self.enter_from(next + 1, until),
            (Phase::Entering { .. }, _) if lapsed => {
                self.keep_entered();
                self.claim_now(now)
            }
            (Phase::Claiming { .. }, None) => self.look_elsewhere(now),
            (Phase::GivingUp { .. }, Some(Land::NAME)) => Phase::Clear,
            (Phase::LookingElsewhere, Some(Plan::NAME)) => self.claim_now(now),
            (Phase::Entering { .. }, None) => self.give_in(now),
            (Phase::GivingWay, Some(GiveWay::NAME)) => {
                self.held = self.ahead.here();
                Phase::Yielding { until: now + PATIENCE }
            }
            (Phase::Entering { next, until }, _) => match Stalled::read(event) {
                Some(stalled) => self.stand_against(&stalled, (next, until), now),
                None => Phase::Entering { next, until },
            },
            (Phase::Yielding { until }, None) if self.met <= until => {
                self.met = Duration::ZERO;
                self.claim_now(now)
            }
            (Phase::Yielding { .. }, None) => self.go_on(now),
            (phase, _) => phase,
        }
    }
}

impl BThread for RightOfWay {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION);
        let bid = bid.wait_for(me.any::<(PeerJoined, PeerLost, InTheWay)>());
        let bid = bid.wait_for(of_every_vehicle::<(Passage, Cornered, Leave, Landed)>());
        // Whoever comes back meanwhile stays out too.
        let holds = |bid: Bid| bid.block(self.of_everyone(self.held.against()));
        let stands = |bid: Bid| bid.block(me.any::<(Advance, Homeward)>());
        Some(match &self.phase {
            Phase::Clear => holds(bid),
            Phase::Claiming { until } => {
                let bid = stands(bid).block(self.claim()).wait_for(me.any::<Confirmed>());
                until.iter().fold(bid, |bid, until| bid.deadline(*until))
            }
            Phase::LookingElsewhere => {
                stands(bid).block(self.claim()).request(me.event(Plan { why: PlanReason::Stuck }))
            }
            Phase::GivingUp { lost } => {
                let why = format!("{lost} was lost in the narrow place ahead, and there is no other way");
                stands(bid).request(me.event(Land { why: why.as_str().into() }))
            }
            Phase::Entering { next, until } => {
                let facts = me.any::<(Stalled, BlockLapsed)>();
                let bid = stands(bid).block(self.claim()).wait_for(facts).deadline(*until);
                self.ahead.enter(*next, me).into_iter().fold(bid, Bid::request)
            }
            Phase::GivingWay => stands(bid).block(self.claim()).request(me.event(GiveWay)),
            Phase::Yielding { until } => stands(holds(bid)).deadline(*until),
            Phase::Asked { of } => {
                let make_way = me.event(MakeWay { of: of.as_str().into() });
                holds(bid).request(make_way).wait_for(me.any::<OutOfTheWay>())
            }
            Phase::MakingWay => holds(bid).wait_for(me.any::<(Cornered, OutOfTheWay)>()),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let now = cx.now();
        let heard = self.hear(event, now);
        let phase = heard.unwrap_or_else(|| self.go_through(event, now));
        self.phase = self.let_out(phase, now);
    }
}

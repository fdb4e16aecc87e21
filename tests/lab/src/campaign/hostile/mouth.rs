//! The hostile member's mouth: turns a habit into messages under its own name, as its credentials allow.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use nalgebra::Vector3;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use skein_bp::{Bound, Event, EventSet};
use skein_dbp::{
    BidAck, BidRecord, Board, BoardRow, JointWord, Lift, Message, NewRoster, NodeName, Occurrence, OnLoss,
    Presence, Refusal, RefusalReason, RemoteBid, Repair, ServedRequest,
};
use skein_sim::fly::{FLEET, GROUND, node_name};
use skein_wire::event::{
    Declared as _, Enter, Events as _, Handover, Load, OrderTaken, SWARM, Takeoff, What,
};
use skein_wire::{
    Check, CheckState, Fleet, Key, Link, MAX_PAYLOAD, MissionState, Payload, Readiness, Route, Scan, Scene,
    State,
};

use super::scripts;
use super::story::{Habit, Rank, Say};

/// It goes on saying that it is there, in so many ticks.
const SIGN_OF_LIFE: u64 = 10;
/// Messages of others that it has in mind.
const OVERHEARD: usize = 64;
/// B-threads that block the same, at most.
const MOST_BLOCKS: usize = 40;
/// B-threads of its own that block what another one of them waits for.
const WAITS_FOR: usize = 8;
/// Names of its own invention.
const INVENTED: usize = 10_000;
/// A field that no version knows, with a length before its content: number 1000.
const UNKNOWN_FIELD: [u8; 2] = [0xc2, 0x3e];

/// What it has said.
#[derive(Debug, Default, Clone, Copy)]
pub struct Said {
    pub messages: u64,
    pub bytes: u64,
    /// Those that can be decoded.
    pub decoded: u64,
}

pub struct Mouth {
    me: NodeName,
    rank: Rank,
    fleet: Fleet,
    link: Box<dyn Link>,
    others: Vec<NodeName>,
    /// Where its vehicle stands, m.
    place: Vector3<f64>,
    life: u64,
    epoch: u64,
    seq: u64,
    tick: u64,
    overheard: VecDeque<(Key, Vec<u8>)>,
    /// The newest sign of life of each of the others.
    signs: BTreeMap<NodeName, Presence>,
    /// Occurrences that each home has repeated for it alone, since somebody last took them.
    pub repeated: BTreeMap<NodeName, u64>,
    pub said: Said,
    /// For each of the others, the messages that were longer than their kind may be.
    pub too_long: BTreeMap<NodeName, u64>,
    /// Everything that was said in this tick and can be decoded.
    pub taken: Vec<Payload>,
}

impl Mouth {
    pub fn new(
        me: NodeName,
        rank: Rank,
        link: Box<dyn Link>,
        others: Vec<NodeName>,
        place: Vector3<f64>,
    ) -> anyhow::Result<Self> {
        Ok(Self {
            me,
            rank,
            fleet: Fleet::new(FLEET)?,
            link,
            others,
            place,
            life: 5,
            epoch: 0,
            seq: 0,
            tick: 0,
            overheard: VecDeque::new(),
            signs: BTreeMap::new(),
            repeated: BTreeMap::new(),
            said: Said::default(),
            too_long: BTreeMap::new(),
            taken: Vec::new(),
        })
    }

    /// Listens, and says what is due in this tick.
    pub fn speak(&mut self, tick: u64, habits: &[Habit]) {
        self.tick = tick;
        self.taken.clear();
        self.listen();
        if tick.is_multiple_of(SIGN_OF_LIFE) {
            self.put_presence(self.presence());
            if self.rank == Rank::Vehicle {
                self.put_state(self.state());
            }
        }
        for habit in habits.iter().filter(|habit| habit.is_due(tick)) {
            let mut random = ChaCha8Rng::seed_from_u64(habit.seed.wrapping_add(tick));
            self.say(habit, &mut random);
        }
    }

    fn listen(&mut self) {
        while let Some((key, payload)) = self.link.poll() {
            if key.is_of::<Occurrence>() && key.recipient() == Some(&self.me) {
                *self.repeated.entry(key.sender().clone()).or_default() += 1;
            }
            if let Ok(Payload::Message(Message::Presence(presence))) = Payload::decode(&payload) {
                self.signs.insert(key.sender().clone(), presence);
            }
            self.overheard.push_back((key, payload));
            if self.overheard.len() > OVERHEARD {
                self.overheard.pop_front();
            }
        }
    }

    fn say(&mut self, habit: &Habit, random: &mut ChaCha8Rng) {
        if self.rank == Rank::Crowd {
            self.me = invented(random.random_range(0..INVENTED));
        }
        // Sizes of every order, the greatest most often.
        let order = if random.random_bool(0.5) { 1.0 } else { random.random_range(0.75_f64..=1.0) };
        let size = (habit.size.max(1) as f64).powf(order).round() as u64;
        let count = usize::try_from(size).unwrap_or(usize::MAX);
        match habit.say {
            Say::Lives => {
                for _ in 0..size {
                    self.life += 1;
                    self.put_presence(self.presence());
                }
            }
            Say::Absurd => self.absurd(size),
            Say::Ahead => {
                self.put_presence(Presence { latest_seq: self.seq + size, oldest_seq: 1, ..self.presence() })
            }
            Say::Jumps => self.jump(size, random),
            Say::Huge => self.huge(size as f64),
            Say::Words => self.words(count),
            Say::Stale => self.stale(size),
            Say::Deep => self.block_often(&deep(self.blockable(random), count), random),
            Say::Wide => self.block(wide(self.blockable(random), count), random),
            Say::Keeps => self.keep(count, random),
            Say::Many => self.many(count, random),
            Say::Asks => self.ask(count, random),
            Say::Waits => self.wait(count),
            Say::Contradicts => self.contradict(count, random),
            Say::Names => self.names(&"n".repeat(count), random),
            Say::Chunks => self.names(&vec!["**"; count].join("/"), random),
            Say::Fields => self.fields(count, random),
            Say::Refuses => self.refuse(count, random),
            Say::Happens => self.happen(size),
            Say::Long => self.long(count),
            Say::Serves => self.serve(count),
            Say::Wants => self.want(size, random),
            Say::Forges => (0..size).for_each(|_| self.forge(random)),
            Say::Repeats => self.repeat(count),
            Say::Boards => self.board(count, random),
            Say::Checks => self.checks(count),
            Say::Padded => self.padded(count, random),
            Say::Floods => self.flood(size, random),
            Say::Garbage => self.garbage(count, random),
            Say::Loads => self.load(count, random),
            Say::Ends => {
                let home = self.others[1].clone();
                let count = count.min(Bound::RecordRequests.stated());
                self.send_scripts(&home, vec![scripts::that_ends_at_once(); count]);
            }
            Say::Invents => self.invent(count),
        }
    }

    // Who it is.

    fn presence(&self) -> Presence {
        Presence {
            node: self.me.clone(),
            incarnation: self.life,
            up: Duration::from_millis(20 * self.tick),
            latest_seq: self.seq,
            oldest_seq: 1,
            lease_ms: 1000,
            joint: None,
        }
    }

    fn absurd(&mut self, digits: u64) {
        let number = (1_u64 << digits.min(63)) - 1;
        let joint =
            JointWord { term: number, decided: number, heard: Some(Duration::from_secs(number)), asks: true };
        self.life = number;
        self.put_presence(Presence {
            lease_ms: number,
            latest_seq: number,
            joint: Some(joint),
            ..self.presence()
        });
    }

    // Where it is.

    fn state(&self) -> State {
        State {
            incarnation: self.life,
            time: Duration::from_millis(20 * self.tick),
            position: self.place,
            ..State::new(self.me.clone())
        }
    }

    fn jump(&mut self, metres: u64, random: &mut ChaCha8Rng) {
        let reach = metres as f64;
        let place = [(); 3].map(|()| random.random_range(-reach..=reach));
        let velocity = [(); 3].map(|()| random.random_range(-reach..=reach));
        self.put_state(State {
            position: place.into(),
            velocity: velocity.into(),
            armed: true,
            ..self.state()
        });
    }

    fn huge(&mut self, size: f64) {
        let state = State {
            radius_m: size,
            position_sigma_m: size,
            velocity: [size, size, -size].into(),
            battery: 0.0,
            armed: true,
            ..self.state()
        };
        self.put_state(state);
    }

    fn words(&mut self, bytes: usize) {
        let text = "w".repeat(bytes);
        let state = State {
            mode: text.clone(),
            task: text.clone(),
            waiting_for: text.clone(),
            holder: text.clone(),
            asked_by: text.clone(),
            scripts: vec![text; State::MAX_SCRIPTS],
            path: vec![self.place; State::MAX_PATH],
            mission: MissionState::Failed,
            ..self.state()
        };
        self.put_state(state);
    }

    fn stale(&mut self, seconds: u64) {
        let ago = |now: Duration| now.saturating_sub(Duration::from_secs(seconds));
        let state = self.state();
        let to_come = Duration::from_secs(seconds);
        self.put_state(State { time: ago(state.time), ..state.clone() });
        self.put_state(State { time: to_come, ..state.clone() });
        self.put_state(State { incarnation: self.life.saturating_sub(seconds), ..state });
        for home in self.others.clone() {
            let record = self.record(&home, Vec::new());
            let old = BidRecord { epoch: 1, sent_at: to_come, incarnation: 1, ..record.clone() };
            self.put_record(old);
            self.put_record(BidRecord {
                home_incarnation: Some(seconds),
                applied: seconds,
                term: seconds,
                ..record
            });
        }
    }

    // Its wishes.

    /// What it may block, or may not.
    fn blockable(&self, random: &mut ChaCha8Rng) -> EventSet {
        let names = ["**", "*/*/advance", "*/*/takeoff", "*/*/enter", "swarm/**", "*/*/order", "uav/*/land"];
        EventSet::from(pick(random, &names))
    }

    fn bid(&self, name: &str, block: EventSet) -> RemoteBid {
        RemoteBid {
            bthread: name.to_owned(),
            sync: self.epoch + 1,
            requests: Vec::new(),
            block,
            block_since: 1,
            priority: Some(i32::MAX),
            on_loss: if self.epoch.is_multiple_of(2) { OnLoss::Hold } else { OnLoss::Release },
        }
    }

    fn record(&mut self, home: &NodeName, bids: Vec<RemoteBid>) -> BidRecord {
        self.epoch += 1;
        let sign = self.signs.get(home);
        let joint = sign.and_then(|sign| sign.joint);
        BidRecord {
            node: self.me.clone(),
            incarnation: self.life,
            home: home.clone(),
            home_incarnation: sign.map(|sign| sign.incarnation),
            epoch: self.epoch,
            sent_at: Duration::from_millis(20 * self.tick),
            applied: sign.map_or(0, |sign| sign.latest_seq),
            term: joint.map_or(0, |joint| joint.term),
            decided: joint.map_or(0, |joint| joint.decided),
            lease_ms: 1000,
            bids,
        }
    }

    fn block(&mut self, block: EventSet, random: &mut ChaCha8Rng) {
        let bid = self.bid("blocks", block);
        self.bid_to_some(vec![bid], random);
    }

    /// Of as many b-threads as a record of bids may hold.
    fn block_often(&mut self, block: &EventSet, random: &mut ChaCha8Rng) {
        let times = (Bound::RecordNodes.stated() / block.extent().nodes.max(1)).clamp(1, MOST_BLOCKS);
        let bids = (0..times).map(|number| self.bid(&format!("blocks{number}"), block.clone())).collect();
        self.bid_to_some(bids, random);
    }

    fn bid_to_some(&mut self, bids: Vec<RemoteBid>, random: &mut ChaCha8Rng) {
        let home = pick(random, &self.others.clone());
        let record = self.record(&home, bids);
        self.put_record(record);
    }

    fn keep(&mut self, count: usize, random: &mut ChaCha8Rng) {
        self.life += 1;
        self.put_presence(self.presence());
        let first = random.random_range(0..100_000);
        let enter = |number: usize| EventSet::named(format!("uav/{}/enter", first + number));
        let block = EventSet::Or((0..count).map(enter).collect());
        let bid = RemoteBid { on_loss: OnLoss::Hold, ..self.bid("keeps", block) };
        let home = self.others[0].clone();
        let record = self.record(&home, vec![bid]);
        self.put_record(record);
    }

    fn many(&mut self, count: usize, random: &mut ChaCha8Rng) {
        let block = match random.random_range(0..3) {
            0 => EventSet::None,
            1 => Enter::any_of("*/*"),
            _ => EventSet::from("*/*/advance"),
        };
        let bids =
            (0..count).map(|number| self.bid(&format!("b{number}of{}", self.life), block.clone())).collect();
        self.bid_to_some(bids, random);
    }

    /// Events that are others' to decide on: what this rank may ask for by right is left out.
    fn asked(&self, home: &NodeName, random: &mut ChaCha8Rng) -> Event {
        let far = OrderTaken::go_to([200.0, 200.0, 50.0], "mallory");
        let beyond_rank: [Event; 6] = [
            Takeoff.at(home),
            Event::new(home.event_name("land")),
            Event::new(home.event_name("goto")).with("x", 90.0).with("y", 90.0).with("z", 20.0),
            Event::new(home.event_name("hand_back")),
            Event::new(format!("{SWARM}/launch")),
            Event::new(home.event_name("confirmed")).with("bthread", "x").with("sync", 1),
        ];
        let of_operator: [Event; 6] = [
            OrderTaken::plain(pick(random, What::ALL), "mallory").at(home),
            far.at(home),
            Handover { what: What::Take, by: "mallory".into(), to: None }.at(home),
            Lift { node: home.clone(), bthread: "hold".into() }.at(home),
            NewRoster { term: u64::MAX >> 1, coordinator: self.me.clone(), members: self.me.as_str().into() }
                .at(home),
            Event::new(home.event_name("load")).with("script", "garbage"),
        ];
        let among = if random.random_bool(0.5) { beyond_rank } else { of_operator };
        pick(random, &among)
    }

    fn ask(&mut self, count: usize, random: &mut ChaCha8Rng) {
        let home = pick(random, &self.others.clone());
        let requests: Vec<Event> = (0..count).map(|_| self.asked(&home, random)).collect();
        let per_bid = pick(random, &[1, 60, 200]);
        let of_events = |(number, events): (usize, &[Event])| RemoteBid {
            requests: events.to_vec(),
            ..self.bid(&format!("asks{number}"), EventSet::None)
        };
        let bids = requests.chunks(per_bid).enumerate().map(of_events).collect();
        let record = self.record(&home, bids);
        self.put_record(record);
    }

    fn wait(&mut self, count: usize) {
        let abort = |number: usize| Event::new(format!("{SWARM}/abort")).with("n", number as i64);
        // A vehicle may ask for that by right, and may not block it.
        let (awaited, requests) = match self.rank {
            Rank::Vehicle => ("launch", Vec::new()),
            Rank::Operator | Rank::Crowd => ("abort", (0..count).map(abort).collect()),
        };
        let block = EventSet::from(format!("{SWARM}/{awaited}"));
        let keeps = (0..WAITS_FOR).map(|number| self.bid(&format!("keeps{number}"), block.clone()));
        let asks = RemoteBid { requests, ..self.bid("waits", EventSet::None) };
        let bids = keeps.chain([asks]).collect();
        let record = self.record(&GROUND, bids);
        self.put_record(record);
    }

    fn contradict(&mut self, count: usize, random: &mut ChaCha8Rng) {
        let home = pick(random, &self.others.clone());
        for number in 0..count {
            let block = if number % 2 == 0 { EventSet::All } else { EventSet::None };
            let requests = vec![self.asked(&home, random)];
            let bids = vec![RemoteBid { requests, ..self.bid("wavers", block) }];
            // Half of them say something else under the same number.
            self.epoch -= u64::from(number % 4 == 3);
            let record = self.record(&home, bids);
            self.put_record(record);
        }
    }

    fn names(&mut self, name: &str, random: &mut ChaCha8Rng) {
        self.block(EventSet::from(name), random);
        let bid = self.bid(name, EventSet::None);
        self.bid_to_some(vec![bid], random);
        self.block(EventSet::field_is(name, 1), random);
        self.occur(1, Event::new(self.me.event_name("x").replace('x', &name.replace("**", "a"))));
    }

    fn fields(&mut self, count: usize, random: &mut ChaCha8Rng) {
        let keys = (0..count).map(|number| format!("k{number}"));
        let event = keys.fold(Event::new(self.me.event_name("said")), |event, key| event.with(key, 1));
        self.occur(1, event.clone());
        self.block(EventSet::Exactly(event), random);
    }

    // What it answers and tells.

    fn refuse(&mut self, count: usize, random: &mut ChaCha8Rng) {
        let node = pick(random, &self.others.clone());
        let refusal = |number: usize| Refusal {
            bthread: if number == 0 { "hold".to_owned() } else { format!("r{}", number % 10) },
            sync: some_sync(number),
            reason: RefusalReason::ALL[number % RefusalReason::ALL.len()],
        };
        let ack = BidAck {
            home: self.me.clone(),
            home_incarnation: self.life,
            node: node.clone(),
            incarnation: 1,
            epoch: random.random_range(0..500),
            sent_at: Duration::from_millis(20 * self.tick),
            latest_seq: self.seq,
            refused: (0..count).map(refusal).collect(),
        };
        let key = Key::to_one::<BidAck>(&self.fleet, self.me.clone(), node);
        self.put(&key, &Payload::Message(Message::Ack(ack)));
    }

    fn occurrence(&self, event: Event) -> Occurrence {
        Occurrence {
            home: self.me.clone(),
            incarnation: self.life,
            seq: self.seq,
            term: 0,
            event,
            requests_served: Vec::new(),
            requested_by: Vec::new(),
            choice: None,
            at: Duration::from_millis(20 * self.tick),
        }
    }

    /// Something has happened here, so many numbers on.
    fn occur(&mut self, on: u64, event: Event) {
        self.seq += on;
        let occurrence = self.occurrence(event);
        self.put_occurrence(occurrence);
    }

    fn happen(&mut self, count: u64) {
        // The one before is never told.
        self.seq += 1;
        for number in 0..count {
            self.occur(
                1,
                Event::new(self.me.event_name("said")).with("n", i64::try_from(number).unwrap_or(0)),
            );
        }
    }

    fn long(&mut self, bytes: usize) {
        let text = "l".repeat(bytes);
        self.occur(1, Event::new(self.me.event_name("said")).with("text", text.clone()));
        // What an operator may ask for is kept at its home, however long it is.
        if self.rank == Rank::Operator {
            let home = self.others[0].clone();
            let order = OrderTaken::plain(What::Hold, "mallory").at(&home).with("text", text);
            let bid = RemoteBid { requests: vec![order], ..self.bid("orders", EventSet::None) };
            let record = self.record(&home, vec![bid]);
            self.put_record(record);
        }
    }

    /// A script for a vehicle, of about so many sets.
    fn load(&mut self, count: usize, random: &mut ChaCha8Rng) {
        let vehicles: Vec<NodeName> = self.others.iter().filter(|node| **node != *GROUND).cloned().collect();
        let home = pick(random, &vehicles);
        let body = match random.random_range(0..3) {
            0 => scripts::of_many_events(count),
            1 => scripts::of_many_sets(count),
            _ => scripts::that_becomes_long(count),
        };
        self.send_scripts(&home, vec![body]);
    }

    fn send_scripts(&mut self, home: &NodeName, bodies: Vec<serde_json::Value>) {
        let mut bid_for = |(number, body)| {
            let name = format!("s{}of{}", number, self.epoch);
            let load =
                Load { name: None, script: scripts::text(&name, body).into(), by: Some("mallory".into()) };
            RemoteBid { requests: vec![load.at(home)], ..self.bid(&format!("loads{number}"), EventSet::None) }
        };
        let bids = bodies.into_iter().enumerate().map(&mut bid_for).collect();
        let record = self.record(home, bids);
        self.put_record(record);
    }

    /// Vehicles that nobody knows, whose words are long.
    fn invent(&mut self, count: usize) {
        let me = self.me.clone();
        for number in 0..count {
            self.me = invented(number);
            self.occur(1, Event::new(self.me.event_name("said")).with("text", "i".repeat(30_000)));
            self.put_state(self.state());
        }
        self.me = me;
    }

    fn serve(&mut self, count: usize) {
        self.seq += 1;
        let served = |number: usize| ServedRequest {
            node: self.others[number % self.others.len()].clone(),
            incarnation: 1,
            bthread: format!("b{number}"),
            sync: some_sync(number),
        };
        let by = |number: usize| format!("{}#b{number}", self.me).into();
        let of_names = |from: usize, to: usize| {
            let occurrence = Occurrence {
                requests_served: (from..to).map(served).collect(),
                requested_by: (from..to).map(by).collect(),
                ..self.occurrence(Event::new(self.me.event_name("said")))
            };
            Payload::Message(Message::Occurrence(occurrence)).encode()
        };
        // No more names than may be are written at once; written one after another, such messages are one.
        let most = Bound::NamesServed.stated();
        let parts = (0..count).step_by(most).map(|from| of_names(from, (from + most).min(count)));
        let encoded = parts.flatten().collect();
        self.put_bytes(&Key::to_all::<Occurrence>(&self.fleet, self.me.clone()), encoded);
    }

    fn want(&mut self, count: u64, random: &mut ChaCha8Rng) {
        let home = pick(random, &self.others.clone());
        for from_seq in 1..=5 {
            let repair = Repair {
                home: home.clone(),
                incarnation: 1,
                from_seq,
                to_seq: from_seq.saturating_add(count),
                term: 0,
                requester: self.me.clone(),
            };
            self.put_repair(repair);
        }
    }

    /// What another one would say.
    fn forge(&mut self, random: &mut ChaCha8Rng) {
        let other = pick(random, &self.others.clone());
        let event = match random.random_range(0..4) {
            0 => Event::new(format!("{SWARM}/abort")),
            1 => OrderTaken::plain(What::Land, "main").at(&other),
            2 => Takeoff.at(&other),
            _ => Event::new(other.event_name("finished")),
        };
        let own = self.occurrence(event);
        match random.random_range(0..5) {
            0 => self.put_state(State {
                incarnation: 1,
                position: self.place,
                armed: true,
                ..State::new(other)
            }),
            1 => self.put_occurrence(Occurrence {
                home: other,
                incarnation: 1,
                seq: random.random_range(1..500),
                ..own
            }),
            // In the name of the coordinator of a term to come.
            2 => self.put_occurrence(Occurrence { term: u64::from(random.random::<u32>()), ..own }),
            3 => self.put_presence(Presence { node: other, incarnation: u64::MAX, ..self.presence() }),
            _ => {
                let home = pick(random, &self.others.clone());
                let record = self.record(&home, Vec::new());
                self.put_record(BidRecord { node: other, incarnation: 1, epoch: u64::MAX, ..record });
            }
        }
    }

    fn repeat(&mut self, count: usize) {
        let messages: Vec<_> = self.overheard.iter().rev().take(count).cloned().collect();
        for (key, payload) in messages {
            let text = key.to_string().replacen(key.sender().as_str(), self.me.as_str(), 1);
            if let Ok(key) = text.parse::<Key>() {
                self.put_bytes(&key, payload);
            }
        }
    }

    fn board(&mut self, sets: usize, random: &mut ChaCha8Rng) {
        let set =
            if random.random_bool(0.5) { wide(EventSet::All, sets) } else { deep(EventSet::All, sets / 80) };
        let row = |number: usize| BoardRow {
            bthread: format!("b{number}"),
            requests: Vec::new(),
            waits: EventSet::None,
            blocks: if number == 0 { set.clone() } else { EventSet::from("**") },
            interrupts: EventSet::None,
            states: Vec::new(),
            priority: None,
            deadline: None,
            lease: None,
            cut: false,
        };
        let board = Board {
            node: self.me.clone(),
            incarnation: self.life,
            at: Duration::from_millis(20 * self.tick),
            rows: (0..(sets / 20).min(Board::MAX_ROWS)).map(row).collect(),
            left_out: u32::MAX,
        };
        self.put(&Key::to_all::<Board>(&self.fleet, self.me.clone()), &Payload::Board(board));
    }

    fn checks(&mut self, count: usize) {
        let check = |number: usize| Check {
            name: format!("c{number}"),
            state: CheckState::Fails,
            value: "v".repeat(count),
            advice: String::new(),
        };
        let readiness = Readiness {
            node: self.me.clone(),
            incarnation: self.life,
            home: self.place.into(),
            datum: [89.0, 179.0, 0.0],
            checks: (0..count.min(Readiness::MAX_CHECKS)).map(check).collect(),
            mission: vec![self.place.into(); count.min(Route::MOST_POINTS)],
        };
        self.put(&Key::to_all::<Readiness>(&self.fleet, self.me.clone()), &Payload::Readiness(readiness));
    }

    // What has a form and nothing in it.

    fn padded(&mut self, bytes: usize, random: &mut ChaCha8Rng) {
        let (fleet, me, to) = (self.fleet.clone(), self.me.clone(), pick(random, &self.others.clone()));
        let scan = Scan {
            stamp: Duration::ZERO,
            angle_min: 0.0,
            angle_step: 0.1,
            max_range_m: 10.0,
            ranges_m: vec![0.1; 60],
            up_m: Some(0.1),
            down_m: Some(0.1),
            upright_m: Vec::new(),
        };
        let scene = Scene { min: Vector3::zeros(), max: self.place, solids: Vec::new() };
        let record = self.record(&to, Vec::new());
        let repair = Repair {
            home: to.clone(),
            incarnation: 1,
            from_seq: 1,
            to_seq: 2,
            term: 0,
            requester: me.clone(),
        };
        let said = self.occurrence(Event::new(me.event_name("said")));
        let board = Board {
            node: me.clone(),
            incarnation: self.life,
            at: Duration::ZERO,
            rows: Vec::new(),
            left_out: 0,
        };
        let (key, payload) = match random.random_range(0..8) {
            0 => (Key::to_all::<State>(&fleet, me), Payload::State(self.state())),
            1 => (Key::to_all::<Presence>(&fleet, me), Payload::Message(Message::Presence(self.presence()))),
            2 => (Key::to_one::<BidRecord>(&fleet, me, to), Payload::Message(Message::Bid(record))),
            3 => (Key::to_all::<Occurrence>(&fleet, me), Payload::Message(Message::Occurrence(said))),
            4 => (Key::to_one::<Repair>(&fleet, me, to), Payload::Message(Message::Repair(repair))),
            5 => (Key::to_one::<Scan>(&fleet, me, to), Payload::Scan(scan)),
            6 => (Key::to_all::<Board>(&fleet, me), Payload::Board(board)),
            _ => (Key::to_all::<Scene>(&fleet, me), Payload::Scene(scene)),
        };
        let mut encoded = payload.encode();
        let bytes = bytes.min(MAX_PAYLOAD - encoded.len() - 8);
        encoded.extend(UNKNOWN_FIELD);
        encoded.extend(varint(bytes));
        encoded.resize(encoded.len() + bytes, 0);
        self.put_bytes(&key, encoded);
    }

    fn flood(&mut self, count: u64, random: &mut ChaCha8Rng) {
        let (home, is_long) = (pick(random, &self.others.clone()), random.random_bool(0.3));
        let text = if is_long { "f".repeat(4000) } else { String::new() };
        for _ in 0..count {
            let repair = Repair {
                home: home.clone(),
                incarnation: 9,
                from_seq: 1,
                to_seq: 1,
                term: 0,
                requester: self.me.clone(),
            };
            match random.random_bool(0.5) {
                true => self.put_repair(repair),
                false => self.occur(1, Event::new(self.me.event_name("said")).with("text", text.clone())),
            }
        }
    }

    fn garbage(&mut self, bytes: usize, random: &mut ChaCha8Rng) {
        let mut payload = vec![0; bytes.min(MAX_PAYLOAD * 2)];
        random.fill_bytes(&mut payload);
        self.put_bytes(&Key::to_all::<State>(&self.fleet, self.me.clone()), payload);
    }

    // Its voice.

    fn put_presence(&mut self, presence: Presence) {
        let key = Key::to_all::<Presence>(&self.fleet, self.me.clone());
        self.put(&key, &Payload::Message(Message::Presence(presence)));
    }

    fn put_state(&mut self, state: State) {
        self.put(&Key::to_all::<State>(&self.fleet, self.me.clone()), &Payload::State(state));
    }

    fn put_record(&mut self, record: BidRecord) {
        let key = Key::to_one::<BidRecord>(&self.fleet, self.me.clone(), record.home.clone());
        self.put(&key, &Payload::Message(Message::Bid(record)));
    }

    fn put_occurrence(&mut self, occurrence: Occurrence) {
        let key = Key::to_all::<Occurrence>(&self.fleet, self.me.clone());
        self.put(&key, &Payload::Message(Message::Occurrence(occurrence)));
    }

    fn put_repair(&mut self, repair: Repair) {
        let key = Key::to_one::<Repair>(&self.fleet, self.me.clone(), repair.home.clone());
        self.put(&key, &Payload::Message(Message::Repair(repair)));
    }

    fn put(&mut self, key: &Key, payload: &Payload) {
        self.put_bytes(key, payload.encode());
    }

    fn put_bytes(&mut self, key: &Key, bytes: Vec<u8>) {
        self.said.messages += 1;
        self.said.bytes += bytes.len() as u64;
        if let Ok(payload) = Payload::decode(&bytes) {
            self.said.decoded += 1;
            if bytes.len() <= key.most_bytes() {
                self.taken.push(payload);
            }
        }
        if bytes.len() > stated_bytes(key) {
            self.note_too_long(key);
        }
        self.link.put(key, bytes);
    }

    fn note_too_long(&mut self, key: &Key) {
        // Vehicles read no boards.
        let hears = |node: &&NodeName| {
            key.recipient().is_none_or(|to| to == *node) && (!key.is_of::<Board>() || **node == *GROUND)
        };
        for node in self.others.iter().filter(hears) {
            *self.too_long.entry(node.clone()).or_default() += 1;
        }
    }
}

/// The most that is let through of a message under this key.
fn stated_bytes(key: &Key) -> usize {
    let bound = match () {
        () if key.is_of::<Presence>() || key.is_of::<Repair>() => Bound::PresenceBytes,
        () if key.is_of::<State>() => Bound::StateBytes,
        () if key.is_of::<BidRecord>() || key.is_of::<BidAck>() => Bound::BidBytes,
        () if key.is_of::<Occurrence>() => Bound::OccurrenceBytes,
        () if key.is_of::<Board>() || key.is_of::<Readiness>() => Bound::BoardBytes,
        () if key.is_of::<Scan>() => Bound::ScanBytes,
        () => Bound::SceneBytes,
    };
    bound.stated()
}

fn deep(inner: EventSet, levels: usize) -> EventSet {
    (0..levels).fold(inner, |set, level| match level % 5 {
        4 => EventSet::Or(vec![set, EventSet::from("x/y/z")]),
        _ => EventSet::And(vec![set, EventSet::All]),
    })
}

fn wide(inner: EventSet, sets: usize) -> EventSet {
    let one = |number: usize| EventSet::named(format!("uav/{number}/enter"));
    EventSet::Or((0..sets).map(one).chain([inner]).collect())
}

fn pick<T: Clone>(random: &mut ChaCha8Rng, among: &[T]) -> T {
    among[random.random_range(0..among.len())].clone()
}

fn some_sync(number: usize) -> u64 {
    1 + number as u64 % 7
}

fn invented(number: usize) -> NodeName {
    node_name("uav", &format!("x{number}"))
}

fn varint(mut number: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    while number > 127 {
        bytes.push((number & 127) as u8 | 128);
        number >>= 7;
    }
    bytes.push(number as u8);
    bytes
}

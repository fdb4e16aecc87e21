//! An operator at a ground station's console, as a program: a WebSocket client that orders and sees who has heard.

use std::collections::{BTreeMap, BTreeSet};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use serde_json::{Value, json};
use skein_dbp::facts::DiskFails;
use skein_wire::event::Declared as _;
use tungstenite::{Message, WebSocket, stream::MaybeTlsStream};

/// Patience with the console, a swarm, or an answer.
const PATIENCE: Duration = Duration::from_secs(120);

/// A connection to a console.
pub struct Operator {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    console: SocketAddr,
    /// The nodes whose disk fails, as the console has told.
    disks_that_fail: BTreeSet<String>,
}

impl Operator {
    /// Connects, as soon as the console answers.
    ///
    /// # Errors
    /// It does not answer.
    pub fn connect(console: SocketAddr) -> anyhow::Result<Self> {
        let deadline = Instant::now() + PATIENCE;
        loop {
            match tungstenite::connect(format!("ws://{console}/live")) {
                Ok((socket, _)) => {
                    if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
                        stream.set_nodelay(true)?;
                    }
                    return Self { socket, console, disks_that_fail: BTreeSet::new() }.introduced();
                }
                Err(error) if Instant::now() > deadline => {
                    return Err(error).context("the console does not answer");
                }
                Err(_) => std::thread::sleep(Duration::from_millis(50)),
            }
        }
    }

    /// Says who speaks: the station sets nothing going for somebody without a name.
    fn introduced(mut self) -> anyhow::Result<Self> {
        let hello = json!({ "type": "hello", "name": env!("CARGO_PKG_NAME") });
        self.socket.send(Message::text(hello.to_string()))?;
        Ok(self)
    }

    /// The console's address.
    pub fn console(&self) -> SocketAddr {
        self.console
    }

    /// Waits until all of so many vehicles have their motors armed.
    ///
    /// # Errors
    /// They have not within two minutes.
    pub fn await_armed(&mut self, vehicles: usize) -> anyhow::Result<()> {
        let deadline = Instant::now() + PATIENCE;
        loop {
            ensure!(
                Instant::now() < deadline,
                "the swarm was not in the air within {} s",
                PATIENCE.as_secs()
            );
            let message = self.next()?;
            let armed =
                message["vehicles"].as_array().map(|all| all.iter().filter(|v| v["armed"] == true).count());
            if message["type"] == "fleet" && armed == Some(vehicles) {
                return Ok(());
            }
        }
    }

    /// Gives an order, to `"all"` or a list of vehicles; returns how long it took until all of them had acknowledged
    /// it.
    ///
    /// # Errors
    /// Somebody has not within two minutes, or refuses it.
    pub fn order(&mut self, what: &str, to: &Value) -> anyhow::Result<Duration> {
        let began = Instant::now();
        let order = json!({ "type": "order", "tag": what, "what": what, "to": to });
        self.socket.send(Message::text(order.to_string()))?;
        let mut number = None;
        let mut newest = Value::Null;
        while began.elapsed() < PATIENCE {
            let message = self.next()?;
            match message["type"].as_str() {
                Some("ordered") => number = Some(message["id"].clone()),
                Some("orders") => {
                    newest =
                        message["orders"].as_array().and_then(|all| all.last()).cloned().unwrap_or_default();
                }
                Some("error") => anyhow::bail!("`{what}` is refused: {}", message["message"]),
                _ => continue,
            }
            let answers = newest["answers"].as_object();
            let all = answers.is_some_and(|all| all.values().all(|answer| answer["state"] == "acknowledged"));
            if number.as_ref() == Some(&newest["id"]) && all {
                return Ok(began.elapsed());
            }
        }
        anyhow::bail!("`{what}` was not acknowledged by all: {newest}")
    }

    /// Sends a script to everybody; returns why it was refused, or `None` if it was taken.
    ///
    /// # Errors
    /// There is no answer within two minutes.
    pub fn load(&mut self, script: &Value) -> anyhow::Result<Option<String>> {
        let began = Instant::now();
        let order = json!({ "type": "order", "tag": "load", "what": "load", "to": "all", "script": script });
        self.socket.send(Message::text(order.to_string()))?;
        while began.elapsed() < PATIENCE {
            let message = self.next()?;
            match message["type"].as_str() {
                Some("ordered") => return Ok(None),
                Some("error") => return Ok(message["message"].as_str().map(str::to_owned)),
                _ => {}
            }
        }
        anyhow::bail!("a script was not answered")
    }

    /// Draws a zone; returns how long it took until every vehicle kept it, on its disk.
    ///
    /// # Errors
    /// Somebody has not within two minutes, or refuses it.
    pub fn draw(&mut self, zone: &Value) -> anyhow::Result<Duration> {
        let kept = |records: &[Value]| {
            let drawn = records.iter().find(|record| record["zone"]["name"] == zone["name"]);
            let answers = drawn.filter(|record| record["going"] == false).map(|record| &record["answers"]);
            let answers = answers.and_then(Value::as_object);
            answers.is_some_and(|all| all.values().all(|answer| answer["state"] == "acknowledged"))
        };
        self.change_map(&json!({ "type": "draw", "tag": "draw", "zone": zone }), kept)
    }

    /// Draws a zone; gives the vehicles that will not keep it, with the reason, once every vehicle has answered.
    ///
    /// # Errors
    /// Somebody has not within two minutes, or the station refuses it.
    pub fn draw_or_refuse(&mut self, zone: &Value) -> anyhow::Result<BTreeMap<String, String>> {
        let mut refusals = BTreeMap::new();
        let answered = |records: &[Value]| {
            let drawn = records.iter().find(|record| record["zone"]["name"] == zone["name"]);
            let Some(answers) = drawn.and_then(|record| record["answers"].as_object()) else { return false };
            let refused = answers.iter().filter(|(_, answer)| answer["state"] == "refused");
            let why = |(vehicle, answer): (&String, &Value)| (vehicle.clone(), answer["why"].to_string());
            refusals = refused.map(why).collect();
            let is_closed =
                |answer: &Value| answer["state"] == "acknowledged" || answer["state"] == "refused";
            !answers.is_empty() && answers.values().all(is_closed)
        };
        self.change_map(&json!({ "type": "draw", "tag": "draw", "zone": zone }), answered)?;
        Ok(refusals)
    }

    /// Waits until the console has told that the disks of these fail, and of some.
    ///
    /// # Errors
    /// It has not within two minutes.
    pub fn await_disks_that_fail(&mut self, nodes: &BTreeSet<String>) -> anyhow::Result<()> {
        let began = Instant::now();
        while nodes.is_empty() || !nodes.is_subset(&self.disks_that_fail) {
            let told = &self.disks_that_fail;
            ensure!(began.elapsed() < PATIENCE, "the console tells that the disks of {told:?} fail");
            self.next()?;
        }
        Ok(())
    }

    /// Removes a zone; returns how long it took until no vehicle had regard for it.
    ///
    /// # Errors
    /// Somebody has within two minutes.
    pub fn erase(&mut self, name: &str) -> anyhow::Result<Duration> {
        let gone = |records: &[Value]| records.iter().all(|record| record["zone"]["name"] != name);
        self.change_map(&json!({ "type": "erase", "tag": "erase", "name": name }), gone)
    }

    fn change_map(
        &mut self,
        request: &Value,
        mut is_done: impl FnMut(&[Value]) -> bool,
    ) -> anyhow::Result<Duration> {
        let began = Instant::now();
        self.socket.send(Message::text(request.to_string()))?;
        let (mut answered, mut done) = (false, false);
        while began.elapsed() < PATIENCE {
            let message = self.next()?;
            match message["type"].as_str() {
                Some("mapped") => answered = true,
                Some("zones") => done = message["zones"].as_array().is_some_and(|all| is_done(all)),
                Some("error") => anyhow::bail!("{request} is refused: {}", message["message"]),
                _ => continue,
            }
            if answered && done {
                return Ok(began.elapsed());
            }
        }
        anyhow::bail!("{request} was not taken in by all")
    }

    fn next(&mut self) -> anyhow::Result<Value> {
        loop {
            if let Message::Text(text) = self.socket.read()? {
                let message: Value = serde_json::from_str(&text)?;
                self.note_disks(&message);
                return Ok(message);
            }
        }
    }

    fn note_disks(&mut self, message: &Value) {
        let events = message["events"].as_array().into_iter().flatten();
        let names = events.filter_map(|event| event["name"].as_str()?.rsplit_once('/'));
        let fails = names.filter(|(_, kind)| *kind == DiskFails::NAME).map(|(home, _)| home.to_owned());
        self.disks_that_fail.extend(fails);
    }
}

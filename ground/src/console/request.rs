//! The requests of browsers: that something is done, or to be told why a vehicle does what it does.

use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::Duration;

use nalgebra::Vector3;
use serde::Deserialize;
use skein_bp::script::{Assignment, ScriptFile};
use skein_dbp::NodeName;
use skein_wire::event::{OrderGiven, What};
use skein_wire::{Destination, Details, Order, Who, Zone, ZoneTable};
use tokio::sync::oneshot;

use crate::core::GroundCore;
use crate::giver::Giver;
use crate::launch_offer::LaunchOffer;
use crate::order::to_send;
use crate::planning::{FleetPlan, FleetProblem};
use crate::refusal::Refusal;
use crate::replay::Replay;

/// A wish to the station.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Wanted {
    Order(Order),
    /// To be told what this launch would launch, under this token.
    Offer(What, String),
    /// The launch that was offered under this token.
    Launch(String),
    /// The facts needed to plan for these vehicles to these targets.
    Survey(Who, Vec<Vector3<f64>>),
    /// That a zone is drawn.
    Draw(Zone),
    /// That the zone of this name is removed.
    Erase(String),
    /// That a recording goes on otherwise.
    Replay(ReplayMessage),
}

/// A wish on its way to the station.
pub struct Wish {
    by: Giver,
    wanted: Wanted,
    answer: oneshot::Sender<Given>,
}

/// The station's answer to a wish, or why there is none.
pub(super) type Given = Result<Granted, Refusal>;

/// The station's answer to a wish.
#[derive(Debug)]
pub(super) enum Granted {
    /// The number under which it has given an order.
    Ordered(u64),
    Offered(LaunchOffer),
    Surveyed(Box<FleetProblem>),
    /// The zone of this name is drawn, or being removed.
    Mapped(String),
    /// The recording goes on as wished.
    Replayed,
}

impl Wish {
    /// Has the station do it, and tells the browser what came of it.
    pub fn carry_out(self, station: &mut GroundCore) {
        let Self { by, wanted, answer } = self;
        let granted = match wanted {
            Wanted::Order(order) => station.order(&by, &order).map(Granted::Ordered),
            Wanted::Offer(what, token) => station.offer_launch(&by, what, token).map(Granted::Offered),
            Wanted::Launch(token) => station.launch(&by, &token).map(Granted::Ordered),
            Wanted::Draw(zone) => {
                let name = zone.name().to_owned();
                station.draw(&by, zone).map(|()| Granted::Mapped(name))
            }
            Wanted::Erase(name) => station.erase(&by, &name).map(|()| Granted::Mapped(name)),
            Wanted::Survey(who, targets) => {
                station.survey(&who, targets).map(Box::new).map(Granted::Surveyed)
            }
            Wanted::Replay(_) => Err(Refusal::NotRecorded),
        };
        // Who asked may have closed the page.
        let _ = answer.send(granted);
    }
}

impl Wish {
    /// Has a recording go on as is wished; nobody is ordered anything by it.
    pub fn carry_out_on(self, replay: &mut Replay) {
        let Self { wanted, answer, .. } = self;
        let granted = match wanted {
            Wanted::Replay(ReplayMessage { play, at_s, speed, .. }) => {
                if let Some(at) = at_s.and_then(|at_s| Duration::try_from_secs_f64(at_s).ok()) {
                    replay.seek(at);
                }
                speed.into_iter().for_each(|speed| replay.set_speed(speed));
                play.into_iter().for_each(|play| replay.play(play));
                Ok(Granted::Replayed)
            }
            _ => Err(Refusal::Recorded),
        };
        // Who asked may have closed the page.
        let _ = answer.send(granted);
    }
}

impl std::fmt::Display for Wish {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.wanted {
            Wanted::Order(order) => write!(f, "{} orders {} for {}", self.by, order.what(), order.who()),
            Wanted::Offer(what, _) => write!(f, "{} asks what {what} would launch", self.by),
            Wanted::Launch(_) => write!(f, "{} confirms a launch", self.by),
            Wanted::Survey(who, _) => write!(f, "{} asks for a plan for {who}", self.by),
            Wanted::Draw(zone) => write!(f, "{} draws the zone {}", self.by, zone.name()),
            Wanted::Erase(name) => write!(f, "{} removes the zone {name}", self.by),
            Wanted::Replay(_) => write!(f, "{} wants the recording to go on otherwise", self.by),
        }
    }
}

/// The box into which browsers put their wishes.
#[derive(Clone)]
pub(super) struct Mailbox {
    put: SyncSender<Wish>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Mailbox {
    pub(super) fn new(put: SyncSender<Wish>, wake: impl Fn() + Send + Sync + 'static) -> Self {
        Self { put, wake: Arc::new(wake) }
    }

    /// Hands a wish to the station; what came of it follows.
    pub(super) fn put(&self, by: Giver, wanted: Wanted) -> Result<oneshot::Receiver<Given>, &'static str> {
        let (answer, given) = oneshot::channel();
        self.put.try_send(Wish { by, wanted, answer }).map_err(|_| "too many orders wait for the station")?;
        (self.wake)();
        Ok(given)
    }
}

/// The request of a browser.
#[derive(Debug)]
pub(super) enum Request {
    /// To be known by this name from now on.
    Hello(String),
    /// That something is done. It is read when it is known that whoever asks may.
    Order(Box<OrderMessage>),
    /// That something of the map is changed.
    Map(Wanted),
    /// That a recording goes on otherwise.
    Replay(ReplayMessage),
    /// To be told why this vehicle does what it does, from now on; none: nothing more.
    Why(Option<NodeName>),
    /// To be told what a script's file says: its purpose and its parameters.
    Script(Box<ScriptFile>),
    /// To be shown how these vehicles would reach these targets together; nobody is ordered anything.
    Plan(Who, Vec<Vector3<f64>>),
    /// The same, made.
    Planned(Box<FleetPlan>),
}

/// A message of a browser.
#[derive(Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[cfg_attr(test, ts(rename = "ClientMessage"))]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Message {
    /// Says who speaks: whatever sets vehicles going needs a name.
    Hello {
        tag: Option<String>,
        name: String,
    },
    Order(Box<OrderMessage>),
    /// Draws a zone for all vehicles, or draws the one of its name anew.
    Draw {
        tag: Option<String>,
        #[cfg_attr(test, ts(type = "ZoneTable"))]
        zone: ZoneTable,
    },
    /// Removes a zone.
    Erase {
        tag: Option<String>,
        name: String,
    },
    Replay(ReplayMessage),
    Why {
        #[cfg_attr(test, ts(type = "string | null"))]
        vehicle: Option<NodeName>,
    },
    ReadScript {
        tag: Option<String>,
        file: String,
        text: String,
    },
    /// Asks for a plan: so that these vehicles reach these targets (ENU, metres) together. Each route of it is sent as
    /// the order `route`.
    Plan {
        tag: Option<String>,
        to: To,
        targets: Vec<[f64; 3]>,
    },
}

/// A change in how a recording is played.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct ReplayMessage {
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    tag: Option<String>,
    /// Whether it is to play.
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    play: Option<bool>,
    /// Where to go to.
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    at_s: Option<f64>,
    /// The factor by which it is to play faster.
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    speed: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct OrderMessage {
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    tag: Option<String>,
    #[cfg_attr(test, ts(type = "What"))]
    pub(super) what: What,
    to: To,
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    point: Option<(f64, f64, Option<f64>)>,
    /// For `route`: the points, metres ENU.
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    points: Option<Vec<[f64; 3]>>,
    /// The numbers, from 0, of the points that are targets, if the others are only the way there.
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    stops: Option<Vec<usize>>,
    /// For `load`: a script with values for its parameters.
    #[serde(default)]
    #[cfg_attr(test, ts(optional, type = "{ script: unknown, with: Record<string, unknown> }"))]
    script: Option<Assignment>,
    /// For `unload`: the name that the script runs under. For `give`: to whom.
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    name: Option<String>,
    /// For a launch: the token that the first message was answered with.
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    token: Option<String>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(untagged)]
pub(super) enum To {
    Word(String),
    Names(Vec<String>),
}

impl To {
    fn who(self) -> Result<Who, String> {
        match self {
            Self::Word(word) if word == OrderGiven::ALL => Ok(Who::All),
            Self::Word(word) => Err(format!("`to` is {word:?}: expected \"all\" or a list of vehicles")),
            Self::Names(names) if names.is_empty() => Err("`to` names no vehicle".into()),
            Self::Names(names) => {
                let names = names.iter().map(|name| NodeName::new(name)).collect::<Result<_, _>>();
                names.map(Who::These).map_err(|error| error.to_string())
            }
        }
    }
}

/// The beginning of a message: enough to know how long it may take to read the rest.
#[derive(Deserialize)]
struct Heading {
    #[serde(rename = "type")]
    kind: String,
    what: Option<String>,
    tag: Option<String>,
}

fn heading(text: &str) -> Option<Heading> {
    serde_json::from_str(text).ok()
}

/// Whether a message holds a script, which is looked at all around before anything is done with it.
pub(super) fn takes_long(text: &str) -> bool {
    heading(text).is_some_and(|heading| match heading.kind.as_str() {
        "read_script" => true,
        "order" => heading.what.as_deref() == Some(What::Load.word()),
        _ => false,
    })
}

/// The tag under which a message is to be answered.
pub(super) fn tag(text: &str) -> Option<String> {
    heading(text)?.tag
}

/// Reads a message: its tag, and what is asked for or what is wrong with it.
pub(super) fn read(text: &str) -> (Option<String>, Result<Request, String>) {
    match serde_json::from_str::<Message>(text) {
        Ok(Message::Hello { tag, name }) => (tag, Ok(Request::Hello(name))),
        Ok(Message::Order(message)) => (message.tag.clone(), Ok(Request::Order(message))),
        Ok(Message::Plan { tag, to, targets }) => {
            let targets = targets.into_iter().map(Vector3::from).collect();
            (tag, to.who().map(|who| Request::Plan(who, targets)))
        }
        Ok(Message::Draw { tag, zone }) => {
            let zone = Zone::try_from(zone).map_err(|error| format!("`zone`: {error}"));
            (tag, zone.map(|zone| Request::Map(Wanted::Draw(zone))))
        }
        Ok(Message::Replay(message)) => (message.tag.clone(), Ok(Request::Replay(message))),
        Ok(Message::Erase { tag, name }) => (tag, Ok(Request::Map(Wanted::Erase(name)))),
        Ok(Message::Why { vehicle }) => (None, Ok(Request::Why(vehicle))),
        Ok(Message::ReadScript { tag, file, text }) => {
            let script = ScriptFile::parse(&file, &text).map_err(|error| error.to_string());
            (tag, script.map(|script| Request::Script(Box::new(script))))
        }
        Err(error) => (None, Err(format!("not an order or a question: {error}"))),
    }
}

/// Reads a browser's message, and does nothing with it.
///
/// # Errors
/// The fault in it, for people.
pub fn check_message(text: &str) -> Result<(), String> {
    match read(text).1? {
        Request::Order(message) => message.wanted(|| Ok(String::new())).map(drop),
        Request::Hello(name) => Giver::new(&name).map(drop).map_err(|error| error.to_string()),
        _ => Ok(()),
    }
}

impl OrderMessage {
    /// The wish; a launch without its token is to be offered under `token`.
    pub(super) fn wanted(mut self, token: impl FnOnce() -> Result<String, String>) -> Result<Wanted, String> {
        let returned = self.token.take();
        let order = order(self)?;
        match (order.what(), returned) {
            (what, None) if what.is_launch() => Ok(Wanted::Offer(what, token()?)),
            (what, Some(token)) if what.is_launch() => Ok(Wanted::Launch(token)),
            (what, Some(_)) => Err(format!("{what} takes no `token`")),
            (_, None) => Ok(Wanted::Order(order)),
        }
    }
}

fn order(
    OrderMessage { what, to, point, points, stops, script, name, .. }: OrderMessage,
) -> Result<Order, String> {
    let script = script.map(|script| to_send(&script)).transpose().map_err(|error| error.to_string())?;
    let point = point.map(|(x, y, z)| Destination { x, y, z });
    if let (What::Give, Some(name)) = (what, &name) {
        Giver::new(name).map_err(|error| error.to_string())?;
    }
    Order::read(what, to.who()?, Details { point, points, stops, script, name })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(text: &str) -> Result<Wanted, String> {
        match read(text).1? {
            Request::Order(message) => message.wanted(|| Ok("7".into())),
            _ => Err("it is no order".into()),
        }
    }

    #[test]
    fn orders_are_read_for_one_for_some_and_for_all() {
        let hold = r#"{"type":"order","tag":"7","what":"hold","to":"all"}"#;
        assert_eq!(read(hold).0.as_deref(), Some("7"));
        assert_eq!(wanted(hold), Ok(Wanted::Order(Order::new(What::Hold, Who::All))));
        let goto = wanted(r#"{"type":"order","what":"goto","to":["uav/3"],"point":[1,-2.5,null]}"#);
        let who = || Who::only(NodeName::new("uav/3").unwrap());
        assert_eq!(goto, Ok(Wanted::Order(Order::go_to(who(), Destination { x: 1.0, y: -2.5, z: None }))));
        let give = wanted(r#"{"type":"order","what":"give","to":["uav/3"],"name":"Ben"}"#);
        assert_eq!(give, Ok(Wanted::Order(Order::give(who(), "Ben"))));
    }

    #[test]
    fn a_launch_is_offered_first_and_given_for_its_token() {
        let first = wanted(r#"{"type":"order","what":"launch","to":"all"}"#);
        assert_eq!(first, Ok(Wanted::Offer(What::Launch, "7".into())));
        let second = wanted(r#"{"type":"order","what":"launch","to":"all","token":"ab"}"#);
        assert_eq!(second, Ok(Wanted::Launch("ab".into())));
    }

    #[test]
    fn only_what_holds_a_script_takes_long() {
        for (text, long) in [
            (r#"{"type":"order","tag":"7","what":"hold","to":"all"}"#, false),
            (r#"{"type":"order","tag":"7","what":"load","to":"all","script":{}}"#, true),
            (r#"{"type":"read_script","tag":"7","file":"a.toml","text":""}"#, true),
            ("[", false),
        ] {
            assert_eq!(takes_long(text), long, "{text}");
            assert!(text == "[" || tag(text).as_deref() == Some("7"));
        }
    }

    #[test]
    fn a_question_is_about_one_vehicle_or_none() {
        let asked = |text: &str| match read(text).1 {
            Ok(Request::Why(vehicle)) => vehicle.map(|vehicle| vehicle.to_string()),
            _ => panic!("it is no question"),
        };
        assert_eq!(asked(r#"{"type":"why","vehicle":"uav/3"}"#).as_deref(), Some("uav/3"));
        assert_eq!(asked(r#"{"type":"why","vehicle":null}"#), None);
    }

    #[test]
    fn a_script_is_read_from_its_file_and_a_fault_is_told_with_its_line() {
        let read_script = |text: &str| {
            read(
                &serde_json::json!({ "type": "read_script", "tag": "3", "file": "a.toml", "text": text })
                    .to_string(),
            )
        };
        let sound =
            "name = \"a\"\nabout = \"Waits.\"\n[[body]]\nsync = { wait = { any_data = \"{me}/at\" } }\n";
        let (tag, script) = read_script(sound);
        let Ok(Request::Script(script)) = script else { panic!("it is no script") };
        assert_eq!((tag.as_deref(), script.name.as_str()), (Some("3"), "a"));
        let fault = read_script(&sound.replace("sync", "dance")).1.unwrap_err();
        assert!(fault.starts_with("a.toml") && fault.contains("unknown field `dance`"), "{fault}");
        let fault = read_script("name = ").1.unwrap_err();
        assert!(fault.starts_with("a.toml:1"), "{fault}");
    }

    #[test]
    fn what_is_no_order_is_refused_with_the_field_at_fault() {
        for (text, fault) in [
            ("", "not an order"),
            ("[]", "not an order"),
            (r#"{"type":"order","what":"explode","to":"all"}"#, "unknown variant `explode`"),
            (r#"{"type":"order","what":"hold","to":"some"}"#, "`to`"),
            (r#"{"type":"order","what":"hold","to":[]}"#, "`to`"),
            (r#"{"type":"order","what":"hold","to":["uav"]}"#, "uav"),
            (r#"{"type":"order","what":"goto","to":"all"}"#, "`point`"),
            (r#"{"type":"order","what":"goto","to":"all","point":[1e999,0,0]}"#, "number out of range"),
            (r#"{"type":"order","what":"launch","to":["uav/1"]}"#, "for all"),
            (r#"{"type":"order","what":"abort","to":["uav/1"]}"#, "for all"),
            (r#"{"type":"order","what":"route","to":["uav/1"]}"#, "`points`"),
            (r#"{"type":"order","what":"route","to":["uav/1"],"points":[]}"#, "a route of 0 points"),
            (r#"{"type":"order","what":"route","to":"all","points":[[1,2,3]]}"#, "for one vehicle"),
            (r#"{"type":"why","vehicle":"uav"}"#, "`uav` is not a node name"),
            (r#"{"type":"order","what":"load","to":"all"}"#, "needs a `script`"),
            (r#"{"type":"order","what":"unload","to":"all"}"#, "needs the `name`"),
            (r#"{"type":"order","what":"give","to":"all"}"#, "needs the `name`"),
            (r#"{"type":"order","what":"give","to":"all","name":"a/b"}"#, "names no person"),
            (r#"{"type":"order","what":"hold","to":"all","token":"7"}"#, "takes no `token`"),
            (r#"{"type":"hello"}"#, "`name`"),
            (r#"{"type":"plan","to":"some","targets":[]}"#, "`to`"),
            (r#"{"type":"plan","to":"all"}"#, "`targets`"),
            (r#"{"type":"plan","to":"all","targets":[[1,2]]}"#, "length 3"),
            (r#"{"type":"draw","zone":{"name":"a","kind":"moat"}}"#, "unknown variant `moat`"),
            (
                r#"{"type":"draw","zone":{"name":"a","kind":"threat","centre_m":[0,0],"radius_m":-1}}"#,
                "`zone`: `radius_m` is -1.0: expected",
            ),
            (r#"{"type":"erase"}"#, "`name`"),
            (
                r#"{"type":"order","what":"load","to":"all","script":{"script":{"name":"a","about":"","body":[{"dance":1}]}}}"#,
                "a: `body[0]` unknown field `dance`",
            ),
        ] {
            let error = match read(text).1 {
                Ok(_) => wanted(text).expect_err(text),
                Err(error) => error,
            };
            assert!(error.contains(fault), "{text}: {error}");
        }
    }
}

//! The requests of browsers: that something is done, or to be told why a vehicle does what it does.

use std::sync::Arc;
use std::sync::mpsc::SyncSender;

use serde::Deserialize;
use skein_bp::script::{Assignment, ScriptFile};
use skein_dbp::NodeName;
use skein_wire::event::{OrderGiven, What};
use tokio::sync::oneshot;

use crate::core::UnknownVehicle;
use crate::order::{Destination, Order, SentScript, Who};

/// An operator's order that waits for the station.
pub struct Wish {
    pub order: Order,
    answer: oneshot::Sender<Given>,
}

/// The number under which the station has given an order, or why it has not.
pub(super) type Given = Result<u64, UnknownVehicle>;

impl Wish {
    /// Tells the browser what the station has made of it.
    pub fn answer(self, given: Result<u64, UnknownVehicle>) {
        // Who asked may have closed the page.
        let _ = self.answer.send(given);
    }
}

/// The box into which browsers put their orders.
#[derive(Clone)]
pub(super) struct Mailbox {
    put: SyncSender<Wish>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Mailbox {
    pub(super) fn new(put: SyncSender<Wish>, wake: impl Fn() + Send + Sync + 'static) -> Self {
        Self { put, wake: Arc::new(wake) }
    }

    /// Hands an order to the station; its number follows once it is given.
    pub(super) fn put(&self, order: Order) -> Result<oneshot::Receiver<Given>, &'static str> {
        let (answer, number) = oneshot::channel();
        self.put.try_send(Wish { order, answer }).map_err(|_| "too many orders wait for the station")?;
        (self.wake)();
        Ok(number)
    }
}

/// The request of a browser.
#[derive(Debug, PartialEq)]
pub(super) enum Request {
    /// That something is done.
    Order(Order),
    /// To be told why this vehicle does what it does, from now on; none: nothing more.
    Why(Option<NodeName>),
    /// To be told what a script's file says: its purpose and its parameters.
    Script(Box<ScriptFile>),
}

/// A message of a browser.
#[derive(Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[cfg_attr(test, ts(rename = "ClientMessage"))]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Message {
    Order(Box<OrderMessage>),
    Why {
        #[cfg_attr(test, ts(type = "string | null"))]
        vehicle: Option<NodeName>,
    },
    ReadScript {
        tag: Option<String>,
        file: String,
        text: String,
    },
}

#[derive(Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct OrderMessage {
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    tag: Option<String>,
    #[cfg_attr(test, ts(type = "What"))]
    what: What,
    to: To,
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    point: Option<(f64, f64, Option<f64>)>,
    /// For `load`: a script with values for its parameters.
    #[serde(default)]
    #[cfg_attr(test, ts(optional, type = "{ script: unknown, with: Record<string, unknown> }"))]
    script: Option<Assignment>,
    /// For `unload`: the name that the script runs under.
    #[serde(default)]
    #[cfg_attr(test, ts(optional))]
    name: Option<String>,
}

#[derive(Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(untagged)]
enum To {
    Word(String),
    Names(Vec<String>),
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
        Ok(Message::Order(message)) => (message.tag.clone(), order(*message).map(Request::Order)),
        Ok(Message::Why { vehicle }) => (None, Ok(Request::Why(vehicle))),
        Ok(Message::ReadScript { tag, file, text }) => {
            let script = ScriptFile::parse(&file, &text).map_err(|error| error.to_string());
            (tag, script.map(|script| Request::Script(Box::new(script))))
        }
        Err(error) => (None, Err(format!("not an order or a question: {error}"))),
    }
}

fn order(OrderMessage { what, to, point, script, name, .. }: OrderMessage) -> Result<Order, String> {
    let who = match to {
        To::Word(word) if word == OrderGiven::ALL => Who::All,
        To::Word(word) => return Err(format!("`to` is {word:?}: expected \"all\" or a list of vehicles")),
        To::Names(names) if names.is_empty() => return Err("`to` names no vehicle".into()),
        To::Names(names) => {
            let names = names.iter().map(|name| NodeName::new(name)).collect::<Result<_, _>>();
            Who::These(names.map_err(|error| error.to_string())?)
        }
    };
    Ok(match what {
        What::Launch if who != Who::All => {
            return Err("a launch is for all: vehicles take off in turn".into());
        }
        what if what.is_for_all() && who != Who::All => {
            return Err("what is decided together is for all".into());
        }
        What::Load => {
            let script = script.ok_or("`load` needs a `script`: {script, with}")?;
            Order::Load(who, SentScript::new(&script).map_err(|error| error.to_string())?)
        }
        What::Unload => Order::Unload(who, name.ok_or("`unload` needs the `name` of a script")?),
        What::GoTo => {
            let (x, y, z) = point.ok_or("`goto` needs a `point`: [x, y, z or null], metres")?;
            let finite = x.is_finite() && y.is_finite() && z.is_none_or(f64::is_finite);
            if !finite {
                return Err("`point` must be finite numbers".into());
            }
            Order::GoTo(who, Destination { x, y, z })
        }
        what => Order::plain(what, who).ok_or("this order needs more than its word")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_read_for_one_for_some_and_for_all() {
        let (tag, hold) = read(r#"{"type":"order","tag":"7","what":"hold","to":"all"}"#);
        assert_eq!((tag.as_deref(), hold), (Some("7"), Ok(Request::Order(Order::Hold(Who::All)))));
        let (_, goto) = read(r#"{"type":"order","what":"goto","to":["uav/3"],"point":[1,-2.5,null]}"#);
        let who = Who::only(NodeName::new("uav/3").unwrap());
        assert_eq!(goto, Ok(Request::Order(Order::GoTo(who, Destination { x: 1.0, y: -2.5, z: None }))));
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
        let vehicle = NodeName::new("uav/3").unwrap();
        assert_eq!(read(r#"{"type":"why","vehicle":"uav/3"}"#).1, Ok(Request::Why(Some(vehicle))));
        assert_eq!(read(r#"{"type":"why","vehicle":null}"#).1, Ok(Request::Why(None)));
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
        let Ok(Request::Script(script)) = script else { panic!("{script:?}") };
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
            (r#"{"type":"why","vehicle":"uav"}"#, "`uav` is not a node name"),
            (r#"{"type":"order","what":"load","to":"all"}"#, "needs a `script`"),
            (r#"{"type":"order","what":"unload","to":"all"}"#, "needs the `name`"),
            (
                r#"{"type":"order","what":"load","to":"all","script":{"script":{"name":"a","about":"","body":[{"dance":1}]}}}"#,
                "a: `body[0]` unknown field `dance`",
            ),
        ] {
            let error = read(text).1.expect_err(text);
            assert!(error.contains(fault), "{text}: {error}");
        }
    }
}

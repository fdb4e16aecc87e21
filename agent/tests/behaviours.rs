//! Behaviours of crates of one's own: they join the program, are verified with it, and bring their events.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use skein_agent::verify::{Part, Place, Requirement, Scene, VehicleVerifier};
use skein_agent::{AgentConfig, AgentCore, Me};
use skein_bp::behaviour::{Behaviour, Behaviours, Chosen, Host, Model};
use skein_bp::catalogue::{Declaration, Declared as _, Whose};
use skein_bp::{BThread, Bid, Context, Event, EventSet, Program};
use skein_wire::event::{Land, Takeoff};

use crate::verify::config;

skein_bp::events! {
    /// The events of a wind gauge.
    const EVENTS;

    /// Wind too strong to take off in.
    Gust = "gust", Own;
    /// The wind has dropped.
    Calm = "calm", Own;
    /// Somebody asks how strong it is.
    Asked = "asked", Operator;
}

/// Keeps the vehicle on the ground in a gust, or its `verb` from happening.
#[derive(Deserialize)]
struct Gauge {
    #[serde(default = "takeoff")]
    verb: String,
}

fn takeoff() -> String {
    Takeoff::NAME.to_owned()
}

impl Behaviour for Gauge {
    const NAME: &'static str = "gauge";
    const NODES: &'static str = "uav/*";
    const EVENTS: &'static [Declaration] = EVENTS;

    fn load(&self, host: &Host<'_>, program: &mut Program) {
        let verb = self.verb.clone();
        program.add(Self::NAME, Gauging { me: Me::new(host.node), verb, blows: false });
    }

    fn model(&self, host: &Host<'_>, model: &mut Model<'_>) {
        let [gust, calm] = [Gust.at(host.node), Calm.at(host.node)];
        let wind = Part::new(vec![
            Place::new("calm").offers(gust.clone(), "gusts"),
            Place::new("gusts").offers(calm.clone(), "calm"),
        ]);
        model.tell("wind", wind);
        let rule = "in a gust nobody takes off";
        let never = Me::new(host.node).any::<Takeoff>();
        model.require(rule, Requirement::absence(rule, never, gust.into(), calm.into()));
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Gauging {
    me: Me,
    verb: String,
    blows: bool,
}

impl BThread for Gauging {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().wait_for(self.me.any::<(Gust, Calm)>());
        Some(if self.blows { bid.block(EventSet::named(self.me.event_name(&self.verb))) } else { bid })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.blows = Gust::read(event).is_some();
    }
}

fn chosen(settings: Value) -> Chosen {
    let mut known = Behaviours::default();
    known.add::<Gauge>();
    known.choose_for("uav/1", settings.as_object().unwrap()).unwrap()
}

fn with(settings: Value) -> AgentConfig {
    AgentConfig { behaviours: chosen(json!({ "gauge": settings })), ..config() }
}

#[test]
fn a_behaviour_is_verified_with_the_program_and_its_own_part_of_the_world() {
    let verifier = VehicleVerifier::new(&with(json!({}))).unwrap().most_states(2_000);
    assert!(verifier.rules().any(|rule| rule == "in a gust nobody takes off"));
    let report = verifier.verify(Scene::Launch, |_| {});
    assert_eq!(report.report.verdict, None, "{}", report.report);
    assert!(report.coverage.happened.contains(&Gust.at("uav/1")), "the wind never blows");
}

#[test]
fn a_behaviour_that_breaks_its_own_requirement_is_found() {
    let verifier = VehicleVerifier::new(&with(json!({}))).unwrap().without_bthread("gauge");
    let violation = verifier.verify(Scene::Launch, |_| {}).report.verdict.unwrap().to_string();
    assert!(violation.contains("in a gust nobody takes off"), "{violation}");
}

#[test]
fn a_behaviour_that_blocks_a_safety_event_is_found() {
    let verifier = VehicleVerifier::new(&with(json!({ "verb": Land::NAME }))).unwrap();
    let violation = verifier.verify(Scene::Launch, |_| {}).report.verdict.unwrap().to_string();
    assert!(violation.contains("`gauge` blocks `uav/1/land`"), "{violation}");
}

#[test]
fn its_events_are_whose_they_are_declared_to_be() {
    let behaviours = chosen(json!({ "gauge": {} }));
    let own = behaviours.events("uav/1", Whose::Own);
    assert!(own.contains(&Gust.at("uav/1")) && own.contains(&Calm.at("uav/1")));
    assert!(!own.contains(&Asked.at("uav/1")) && !own.contains(&Gust.at("uav/2")));
    assert!(behaviours.events("uav/1", Whose::Operator).contains(&Asked.at("uav/1")));
    assert_eq!(behaviours.events("ground/main", Whose::Own), EventSet::None);
    let core = AgentCore::new(with(json!({}))).unwrap();
    assert!(core.node().node().program().state_of::<Gauging>("gauge").is_some());
}

#[test]
fn a_behaviour_for_other_nodes_is_refused() {
    let mut known = Behaviours::default();
    known.add::<Gauge>();
    let error = known.choose_for("ground/main", json!({ "gauge": {} }).as_object().unwrap()).unwrap_err();
    assert_eq!(error.to_string(), "`behaviours.gauge`: is for nodes `uav/*`, and this is ground/main");
}

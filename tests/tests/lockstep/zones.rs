//! Zones that an operator draws while vehicles fly: they go round, leave, wait or land, whatever becomes of the station.

use std::collections::BTreeSet;
use std::time::Duration;

use nalgebra::{Vector2, Vector3};
use skein_agent::Outcome;
use skein_ground::{Answer, Giver, GroundConfig, GroundCore, Refusal};
use skein_sim::{cli::Controller, fly};
use skein_tests::Lockstep;
use skein_wire::event::What;
use skein_wire::{Fleet, KeptZone, MemoryStore, Order, Who, Zone};

/// Two that fly east beside one another.
const FIELD: &str = "time_limit_s = 200.0\n[bounds]\nmin_m = [-10.0, -40.0, -1.0]\nmax_m = [80.0, 40.0, 15.0]\n\
    [[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[60.0, 0.0, 3.0]]\n\
    [[vehicle]]\nstart_m = [0.0, 8.0]\nwaypoints_m = [[60.0, 8.0, 3.0]]\n";

struct Field {
    flight: Lockstep,
    /// The vehicles that were in the pond since it was drawn.
    wet: BTreeSet<usize>,
    has_pond: bool,
    zones: MemoryStore<Vec<KeptZone>>,
}

impl Field {
    fn new() -> Self {
        let zones = MemoryStore::default();
        let flight = Lockstep::from_text(FIELD);
        let mut field = Self { flight, wet: BTreeSet::new(), has_pond: false, zones };
        field.restart_station(1);
        field
    }

    /// Both are on their way, and this far.
    fn under_way(x_m: f64) -> Self {
        let mut field = Self::new();
        field.until("they do not fly", |field| (0..2).all(|index| field.place(index).x > x_m));
        field
    }

    /// Begins another life of the station, which takes up the zones that the one before has kept.
    fn restart_station(&mut self, incarnation: u64) {
        let fleet = Fleet::new(fly::FLEET).unwrap();
        let config = fly::ground_config(&self.flight.scenario, fleet, Controller::Bp);
        let config = GroundConfig { incarnation, zones: self.zones.kept(), ..config };
        let station = GroundCore::durable(config, Box::new(MemoryStore::default()));
        self.flight.network.leave(&fly::GROUND);
        let link = Box::new(self.flight.network.join(&fly::GROUND));
        self.flight.swarm.restart_ground(station.keeping_zones(Box::new(self.zones.clone())), link);
    }

    fn place(&self, index: usize) -> Vector3<f64> {
        self.flight.swarm.simulation().vehicle(index).unwrap().motion.position
    }

    fn task(&self, index: usize) -> String {
        self.flight.swarm.agents().nth(index).unwrap().status(self.flight.swarm.now()).task
    }

    fn step(&mut self) {
        self.flight.step();
        let wet = (0..2).filter(|index| self.has_pond && self.off_pond_m(*index) < 0.0);
        self.wet.extend(wet.collect::<Vec<_>>());
    }

    fn off_pond_m(&self, index: usize) -> f64 {
        (self.place(index).xy() - Vector2::new(30.0, 4.0)).norm() - 10.0
    }

    fn until(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        let deadline = self.flight.swarm.now() + Duration::from_secs(100);
        while !is_so(self) {
            let status = |index| {
                let agent = self.flight.swarm.agents().nth(index).unwrap();
                (self.place(index), agent.status(self.flight.swarm.now()))
            };
            assert!(self.flight.swarm.now() < deadline, "{what}: {:?}", [0, 1].map(status));
            self.step();
        }
    }

    fn pass(&mut self, seconds: u64) {
        let then = self.flight.swarm.now() + Duration::from_secs(seconds);
        self.until("time passes", |field| field.flight.swarm.now() > then);
    }

    fn draw(&mut self, zone: &str) {
        let zone: Zone = zone.parse().unwrap();
        self.flight.swarm.ground_mut().draw(&Giver::new("Anna").unwrap(), zone).unwrap();
    }

    fn erase(&mut self, name: &str) -> Result<(), Refusal> {
        self.flight.swarm.ground_mut().erase(&Giver::new("Anna").unwrap(), name)
    }

    /// Draws a round zone across both ways, 20 to 40 m east.
    fn draw_pond(&mut self) {
        self.draw(r#"{"name":"pond","kind":"no_fly","centre_m":[30,4],"radius_m":10}"#);
        self.has_pond = true;
    }

    fn answers(&self, name: &str) -> Vec<Answer> {
        let zones = self.flight.swarm.ground().zones();
        let answers = zones.filter(|record| record.zone.name() == name).map(|record| &record.answers);
        answers.flat_map(|answers| answers.values().cloned()).collect()
    }

    fn is_confirmed(&self, name: &str) -> bool {
        let answers = self.answers(name);
        !answers.is_empty() && answers.iter().all(|answer| matches!(answer, Answer::Acknowledged(_)))
    }

    fn all_arrive(&mut self) {
        self.until("they do not all end", |field| field.flight.swarm.outcomes().all(|end| end.is_some()));
        assert!(self.flight.swarm.outcomes().all(|end| end == Some(&Outcome::Complete)));
        for (index, y) in [(0, 0.0), (1, 8.0)] {
            let off_m = (self.place(index).xy() - Vector2::new(60.0, y)).norm();
            assert!(off_m < 1.0, "{index} lands {off_m} m beside");
        }
    }
}

#[test]
fn a_zone_drawn_under_flying_vehicles_is_confirmed_and_gone_round() {
    let mut field = Field::under_way(5.0);
    field.draw_pond();
    field.until("it is not confirmed", |field| field.is_confirmed("pond"));
    for answer in field.answers("pond") {
        assert!(
            matches!(answer, Answer::Acknowledged(after) if after < Duration::from_millis(200)),
            "{answer:?}"
        );
    }
    field.all_arrive();
    assert_eq!(field.wet, BTreeSet::new(), "they could stop outside");
    assert_eq!(field.flight.swarm.truth().collisions_vehicle, 0);
}

#[test]
fn a_vehicle_that_can_just_stop_outside_does_not_enter_though_the_zone_is_drawn_right_before_it() {
    let mut field = Field::new();
    // The zone begins 20.8 m east; the first is further by then.
    field.until("the second does not fly", |field| field.place(1).x > 17.3);
    field.draw_pond();
    field.all_arrive();
    assert!(!field.wet.contains(&1));
}

#[test]
fn whoever_is_inside_leaves_by_the_shortest_way_and_one_that_is_held_leaves_too() {
    for held in [false, true] {
        let mut field = Field::under_way(22.5);
        if held {
            field.flight.swarm.order(&Order::new(What::Hold, Who::All)).unwrap();
            field.pass(3);
        }
        field.draw_pond();
        let inside = (0..2).map(|index| field.place(index)).collect::<Vec<_>>();
        field.until("they do not leave", |field| (0..2).all(|index| field.off_pond_m(index) > 0.0));
        for (index, inside) in inside.iter().enumerate() {
            let way_m = (field.place(index) - inside).xy().norm();
            assert!(way_m < 16.0, "held {held}: {index} has flown {way_m} m");
        }
        if held {
            field.pass(3);
            field.flight.swarm.order(&Order::new(What::Resume, Who::All)).unwrap();
        }
        field.wet.clear();
        field.all_arrive();
        assert_eq!(field.wet, BTreeSet::new(), "held {held}: nobody comes back");
    }
}

#[test]
fn a_goal_in_a_zone_is_waited_for_with_the_reason_told_and_flown_to_once_the_zone_is_removed() {
    let mut field = Field::under_way(5.0);
    field.draw(r#"{"name":"barn","kind":"no_fly","corners_m":[[55,4],[65,4],[65,12],[55,12]]}"#);
    field.until("the second does not say why", |field| {
        field.task(1).contains("waiting for the zone `barn`, which is in the way")
    });
    field.pass(15);
    assert!(field.place(1).x < 55.0 && field.place(1).z > 2.0, "it waits in the air");
    field.erase("barn").unwrap();
    field.until("the zone does not go", |field| field.flight.swarm.ground().zones().count() == 0);
    field.all_arrive();
    assert!(!field.task(1).contains("barn"));
}

#[test]
fn neither_the_way_home_nor_the_way_down_is_ever_closed() {
    let mut field = Field::under_way(22.0);
    field.draw(r#"{"name":"field","kind":"no_fly","centre_m":[30,0],"radius_m":200}"#);
    field.until("it is not confirmed", |field| field.is_confirmed("field"));
    let who = |field: &Field, index: usize| Who::only(field.flight.nodes[index].clone());
    let (home, down) = (who(&field, 0), who(&field, 1));
    field.flight.swarm.order(&Order::new(What::Return, home)).unwrap();
    field.flight.swarm.order(&Order::new(What::Land, down)).unwrap();
    field.until("they do not come down", |field| field.flight.swarm.is_grounded());
}

#[test]
fn a_zone_outlives_the_station_and_its_next_life_takes_it_up_and_may_remove_it() {
    let mut field = Field::under_way(4.0);
    field.draw_pond();
    field.until("it is not confirmed", |field| field.is_confirmed("pond"));
    field.flight.swarm.kill_ground();
    field.pass(3);
    field.restart_station(2);
    field.until("it is not taken up", |field| field.is_confirmed("pond"));
    field.erase("pond").unwrap();
    field.until("it does not go", |field| {
        field.flight.swarm.ground().zones().count() == 0
            && field.flight.swarm.ground().roster().all(|(_, state)| state.unwrap().zones.is_empty())
    });
    assert_eq!(field.zones.kept(), []);
    assert_eq!(field.wet, BTreeSet::new());
    // A life that does not know of it lifts it from the vehicles.
    field.draw_pond();
    field.until("it is not confirmed", |field| field.is_confirmed("pond"));
    field.zones = MemoryStore::default();
    field.restart_station(3);
    field.pass(2);
    assert_eq!(field.flight.swarm.ground().zones().count(), 0);
    let kept = |field: &Field| {
        field.flight.swarm.ground().roster().filter(|(_, state)| !state.unwrap().zones.is_empty()).count()
    };
    assert_eq!(kept(&field), 2);
    assert!(matches!(field.erase("lake"), Err(Refusal::NoSuchZone { .. })));
    field.erase("pond").unwrap();
    field.until("it is not lifted", |field| kept(field) == 0);
}

#[test]
fn whoever_is_cut_off_learns_of_a_zone_before_it_is_let_go_on() {
    let mut field = Field::under_way(3.0);
    field.flight.swarm.order(&Order::new(What::Hold, Who::All)).unwrap();
    field.pass(3);
    let away = field.flight.nodes[0].clone();
    field.flight.network.partition(&[std::slice::from_ref(&away)]);
    field.pass(1);
    field.draw_pond();
    field.until("the other has it", |field| matches!(field.answers("pond")[1], Answer::Acknowledged(_)));
    field.pass(1);
    assert_eq!(field.answers("pond")[0], Answer::Missing);
    field.flight.network.heal();
    field.flight.swarm.order(&Order::new(What::Resume, Who::All)).unwrap();
    field.all_arrive();
    assert_eq!(field.wet, BTreeSet::new());
}

#[test]
fn limits_of_height_and_a_curfew_are_kept() {
    let mut field = Field::new();
    field.draw(r#"{"name":"low","kind":"not_above","height_m":2}"#);
    field.draw(r#"{"name":"night","kind":"no_fly","centre_m":[30,4],"radius_m":10,"from_s":1,"until_s":60}"#);
    field.has_pond = true;
    field.until("they do not fly", |field| (0..2).all(|index| field.place(index).x > 3.0));
    let mut highest_m: f64 = 0.0;
    while field.flight.swarm.outcomes().any(|end| end.is_none()) {
        field.step();
        highest_m = (0..2).map(|index| field.place(index).z).fold(highest_m, f64::max);
        assert!(field.flight.swarm.now() < Duration::from_secs(150), "they do not arrive");
    }
    assert!(highest_m < 2.3, "{highest_m}");
    assert_eq!(field.wet, BTreeSet::new());
}

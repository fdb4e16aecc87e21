//! A route that an operator sends is checked aboard, flown in place of what was left of the mission, or refused with
//! the reason.

use std::time::Duration;

use nalgebra::Vector3;
use skein_agent::Outcome;
use skein_ground::Answer;
use skein_tests::Lockstep;
use skein_wire::event::What;
use skein_wire::{Order, Route, Who};

/// Two that fly east beside one another, with a round zone between north and east.
const FIELD: &str = "time_limit_s = 120.0\n[bounds]\nmin_m = [-10.0, -30.0, -1.0]\nmax_m = [60.0, 30.0, 15.0]\n\
    [[airspace.no_fly]]\ncentre_m = [20.0, -15.0]\nradius_m = 3.0\n\
    [[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[40.0, 0.0, 3.0]]\n\
    [[vehicle]]\nstart_m = [0.0, 8.0]\nwaypoints_m = [[40.0, 8.0, 3.0]]\n";

struct Field(Lockstep);

impl Field {
    /// The first is on its way.
    fn under_way() -> Self {
        let mut field = Self(Lockstep::from_text(FIELD));
        field.until("the first does not fly", |field| field.place().x > 5.0);
        field
    }

    fn place(&self) -> Vector3<f64> {
        self.0.swarm.simulation().vehicle(0).unwrap().motion.position
    }

    fn task(&self) -> String {
        self.0.swarm.agents().next().unwrap().status(self.0.swarm.now()).task
    }

    fn until(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        let deadline = self.0.swarm.now() + Duration::from_secs(60);
        while !is_so(self) {
            assert!(self.0.swarm.now() < deadline, "{what}: {}, {}", self.place(), self.task());
            self.0.step();
        }
    }

    fn first(&self) -> Who {
        Who::only(self.0.nodes[0].clone())
    }

    /// Sends the first a route, and gives back what it answers.
    fn send(&mut self, points: &[[f64; 3]]) -> Answer {
        let route = Order::route(self.0.nodes[0].clone(), Route::new(points.to_vec()).unwrap());
        let id = self.0.swarm.order(&route).unwrap();
        let answer = |field: &Self| {
            let order = field.0.swarm.ground().orders().find(|order| order.id == id).unwrap();
            order.answers[&field.0.nodes[0]].clone()
        };
        self.until("it does not answer", |field| answer(field) != Answer::Pending);
        answer(self)
    }

    fn lands_near(&mut self, place: [f64; 2]) {
        self.until("it does not end its mission", |field| field.0.swarm.outcomes().next().unwrap().is_some());
        assert_eq!(self.0.swarm.outcomes().next().unwrap(), Some(&Outcome::Complete));
        let off_m = (self.place().xy() - nalgebra::Vector2::from(place)).norm();
        assert!(off_m < 0.8, "it lands {off_m} m beside");
    }
}

#[test]
fn a_route_is_flown_in_place_of_the_mission_and_a_newer_one_in_place_of_that() {
    let mut field = Field::under_way();
    assert!(matches!(field.send(&[[10.0, -8.0, 3.0], [0.0, -12.0, 3.0]]), Answer::Acknowledged(_)));
    assert_eq!(field.task(), "leg 1 of 2 of the route by ground main");
    field
        .until("it does not fly there", |field| (field.place() - Vector3::new(10.0, -8.0, 3.0)).norm() < 1.0);
    field.until("it does not go on", |field| field.task().starts_with("leg 2 of 2"));
    assert!(matches!(field.send(&[[30.0, -5.0, 4.0]]), Answer::Acknowledged(_)));
    field.lands_near([30.0, -5.0]);
}

#[test]
fn what_cannot_be_flown_is_refused_with_the_reason_and_the_mission_goes_on() {
    let mut field = Field::under_way();
    for (points, why) in [
        (
            vec![[10.0, 0.0, 3.0], [10.0, 40.0, 3.0]],
            "point 2 of the route, [10.0, 40.0, 3.0], is outside the fence",
        ),
        (vec![[20.0, -14.0, 3.0]], "point 1 of the route, [20.0, -14.0, 3.0], is in a zone"),
        (vec![[40.0, 7.5, 3.0]], "0.5 m beside the place of uav/2"),
    ] {
        match field.send(&points) {
            Answer::Refused(said) => assert!(said.contains(why), "{said}"),
            answer => panic!("{points:?}: {answer:?}"),
        }
    }
    field.lands_near([40.0, 0.0]);
    match field.send(&[[10.0, 0.0, 3.0]]) {
        Answer::Refused(said) => assert_eq!(said, "its mission is over"),
        answer => panic!("on the ground: {answer:?}"),
    }
}

#[test]
fn a_vehicle_that_is_held_takes_on_a_route_and_flies_it_when_resumed() {
    let mut field = Field::under_way();
    let hold = Order::new(What::Hold, field.first());
    field.0.swarm.order(&hold).unwrap();
    field.until("it is not held", |field| {
        field.0.swarm.simulation().vehicle(0).unwrap().motion.velocity.norm() < 0.1
    });
    let held_at = field.place();
    assert!(matches!(field.send(&[[20.0, 3.0, 3.0]]), Answer::Acknowledged(_)));
    let later = field.0.swarm.now() + Duration::from_secs(5);
    field.until("time passes", |field| field.0.swarm.now() > later);
    assert!((field.place() - held_at).norm() < 0.5, "it moves though it is held");
    let resume = Order::new(What::Resume, field.first());
    field.0.swarm.order(&resume).unwrap();
    field.lands_near([20.0, 3.0]);
}

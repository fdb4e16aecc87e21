//! The planner of a fleet.

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_swarm::route::{
    AnyAngleConfig, Assessment, Effort, Plan, Planner, RouteCost, RouteProblem, Traffic, any_angle, refined,
};
use skein_wire::Route;

use super::dealing::{Stop, stops};
use super::fleet_plan::{Alternative, FleetPlan, Journey, Method};
use super::problem::{FleetProblem, Flyer, LeftOut, Open, PlanError};

/// Inner waypoints of a leg that a swarm plans.
const WAYPOINTS: usize = 8;
/// Points of the lattice that A* searches, and of the one where that is too coarse to find a way.
const LATTICE: [usize; 2] = [3_000, 30_000];
/// Routes looked at to refine the best one, beside those of the searches.
const REFINEMENT: usize = 800;

/// Plans for the whole fleet. Vehicles that cannot be planned for are left out, as long as any other is there.
///
/// # Errors
/// [`PlanError`]: a target is no place to fly to, or no vehicle is left.
pub fn plan(problem: &FleetProblem) -> Result<FleetPlan, PlanError> {
    let open = Open::new(&problem.theatre);
    open.check(&problem.targets, &problem.theatre.craft.cost(1.0))?;
    let (mut left_out, mut flyers) = (Vec::new(), Vec::new());
    for flyer in &problem.flyers {
        match objection(flyer, &open, problem) {
            Some(why) => left_out.push(LeftOut { node: flyer.node.clone(), why }),
            None => flyers.push(flyer),
        }
    }
    loop {
        match routes(&flyers, &open, problem) {
            Some(Ok(journeys)) => return Ok(FleetPlan::new(journeys, left_out, problem)),
            // Its targets go to those that are left.
            Some(Err((index, why))) => {
                left_out.push(LeftOut { node: flyers.remove(index).node.clone(), why })
            }
            None => return Err(PlanError::NoVehicle(left_out)),
        }
    }
}

/// Why nothing is planned for a vehicle, if so.
fn objection(flyer: &Flyer, open: &Open, problem: &FleetProblem) -> Option<String> {
    let craft = &problem.theatre.craft;
    let cost = craft.cost(flyer.battery);
    if craft.endurance_s > 0.0 && flyer.battery <= cost.reserve {
        return Some(format!("has {:.0} % left in its battery", flyer.battery * 100.0));
    }
    if !flyer.position.iter().all(|metres| metres.is_finite()) {
        return Some("does not know where it is".to_owned());
    }
    open.objection(&open.entry(&flyer.position, &cost), &cost).map(|why| format!("{why}, where it is"))
}

/// The routes of these vehicles, each among those before it; or whose there is none of, and why. `None` if there is
/// nobody to plan for.
fn routes(
    flyers: &[&Flyer],
    open: &Open,
    problem: &FleetProblem,
) -> Option<Result<Vec<Journey>, (usize, String)>> {
    let craft = &problem.theatre.craft;
    let costs: Vec<_> = flyers.iter().map(|flyer| craft.cost(flyer.battery)).collect();
    let entries: Vec<_> =
        flyers.iter().zip(&costs).map(|(flyer, cost)| open.entry(&flyer.position, cost)).collect();
    let from = |index: usize| flyers[index].stops.last().copied().unwrap_or(entries[index]);
    let starts: Vec<_> = (0..flyers.len()).map(|index| (from(index), costs[index])).collect();
    let dealt = stops(&starts, &problem.targets, problem.one_to_each, craft.spacing_m, &open.airspace)?;
    let goes = |node: &NodeName| {
        flyers.iter().zip(&dealt).any(|(flyer, stops)| flyer.node == *node && !stops.is_empty())
    };
    let mut traffic = Traffic::default();
    for other in problem.others.iter().filter(|other| !goes(&other.node)) {
        traffic.add(&other.way, &craft.cost(1.0));
    }
    let mut journeys = Vec::new();
    for (index, stops) in dealt.iter().enumerate().filter(|(_, stops)| !stops.is_empty()) {
        let cost = costs[index];
        let legs = Legs { open, cost, traffic: &traffic, seed: problem.seed.wrapping_add(index as u64) };
        match legs.journey(flyers[index], entries[index], stops) {
            Ok(journey) => {
                traffic.add(&journey.route, &cost);
                journeys.push(journey);
            }
            Err(why) => return Some(Err((index, why))),
        }
    }
    Some(Ok(journeys))
}

/// The common part of the legs of one vehicle's journey.
struct Legs<'a> {
    open: &'a Open,
    cost: RouteCost,
    traffic: &'a Traffic,
    seed: u64,
}

impl Legs<'_> {
    /// The journey from where a vehicle is, by its entry into the open air, through its stops.
    fn journey(&self, flyer: &Flyer, entry: Vector3<f64>, stops: &[Stop]) -> Result<Journey, String> {
        let new = stops.iter().map(|(_, place)| *place);
        let places: Vec<_> = flyer.stops.iter().copied().chain(new).collect();
        let way = |by| self.way(by, flyer.position, entry, &places);
        let mut found: Vec<_> = [Method::Swarm, Method::Lattice].into_iter().filter_map(way).collect();
        found.sort_by(|one, other| one.assessment.cost_m.total_cmp(&other.assessment.cost_m));
        let mut found = found.into_iter();
        let best = found.next().ok_or("finds no way that keeps clear of terrain, zones and others")?;
        let (points, most) = (best.route.len() - 1, Route::MOST_POINTS);
        if points > most {
            return Err(format!(
                "would get a route of {points} points, and can take {most}: name fewer targets"
            ));
        }
        let left_s = self.cost.endurance_s;
        if best.assessment.time_s > left_s {
            return Err(format!(
                "would fly {:.0} s, and its battery lasts for {left_s:.0} s",
                best.assessment.time_s
            ));
        }
        Ok(Journey {
            node: flyer.node.clone(),
            targets: stops.iter().map(|(number, _)| *number).collect(),
            route: best.route,
            stops: best.stops,
            assessment: best.assessment,
            by: best.by,
            second: found.next(),
            slowed: 1.0,
        })
    }

    /// The whole way by one planner, if it finds any that is clear of everything.
    fn way(
        &self,
        by: Method,
        at: Vector3<f64>,
        entry: Vector3<f64>,
        places: &[Vector3<f64>],
    ) -> Option<Alternative> {
        let mut route = if at == entry { vec![entry] } else { vec![at, entry] };
        let (mut from, mut stops) = (entry, Vec::new());
        for place in places {
            let leg = self.leg(by, from, *place)?;
            route.extend_from_slice(&leg.route[1..]);
            stops.push(route.len() - 1);
            from = *place;
        }
        let assessment = self.cost.assess(&route, &self.open.airspace, self.traffic);
        Some(Alternative { by, route, stops, assessment })
    }

    fn leg(&self, by: Method, from: Vector3<f64>, to: Vector3<f64>) -> Option<Plan> {
        let airspace = &self.open.airspace;
        let mut problem = RouteProblem::new(airspace, self.traffic, self.cost, (from, to), WAYPOINTS).ok()?;
        let found = match by {
            Method::Swarm => Some(Planner::Ground.plan(&mut problem, Effort::default(), self.seed)),
            Method::Lattice => LATTICE
                .into_iter()
                .find_map(|points| any_angle(&problem, &AnyAngleConfig::within(airspace, points, 0))),
        }?;
        let taut = AnyAngleConfig::within(airspace, LATTICE[0], REFINEMENT);
        Some(refined(&found.route, &problem, &taut)).filter(|plan| is_clear(&plan.assessment))
    }
}

/// Nothing is violated but, perhaps, what the battery lasts for.
fn is_clear(assessment: &Assessment) -> bool {
    assessment.violation_m <= 0.0 || assessment.reserve_used > 1.0
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use skein_dbp::NodeName;
    use skein_planning::airspace::{Airspace, Area, NoFlyPrism, StayInside, ThreatZone};

    use skein_swarm::route::Craft;

    use super::super::problem::Other;
    use super::super::theatre::Theatre;
    use super::*;

    const SPACE: (Vector3<f64>, Vector3<f64>) =
        (Vector3::new(-5.0, -5.0, 0.0), Vector3::new(105.0, 105.0, 40.0));

    fn node(number: usize) -> NodeName {
        NodeName::new(&format!("uav/{number}")).unwrap()
    }

    fn flyer(number: usize, at: [f64; 3]) -> Flyer {
        Flyer { node: node(number), position: at.into(), battery: 1.0, stops: vec![] }
    }

    fn problem(airspace: Airspace, flyers: Vec<Flyer>, targets: &[[f64; 3]]) -> FleetProblem {
        let theatre =
            Theatre::new(airspace, SPACE, Craft { endurance_s: 600.0, ..Craft::default() }).unwrap();
        let targets = targets.iter().map(|at| Vector3::from(*at)).collect();
        FleetProblem { theatre, flyers, others: vec![], targets, one_to_each: false, seed: 1 }
    }

    fn valley() -> Airspace {
        let outline = [[60.0, 60.0], [80.0, 60.0], [80.0, 80.0], [60.0, 80.0]];
        Airspace {
            threats: vec![ThreatZone { centre: Vector2::new(50.0, 40.0), radius_m: 20.0 }],
            prisms: vec![NoFlyPrism {
                corners: outline.map(Vector2::from).to_vec(),
                floor_m: 0.0,
                ceiling_m: 100.0,
            }],
            stay_inside: vec![StayInside { any_of: vec![Area::round(Vector2::new(50.0, 50.0), 70.0)] }],
            ..Airspace::default()
        }
    }

    fn six() -> FleetProblem {
        let flyers = (0..6).map(|k| flyer(k + 1, [3.0, 20.0 + 12.0 * k as f64, 5.0])).collect();
        problem(valley(), flyers, &[[95.0, 30.0, 8.0], [95.0, 50.0, 10.0], [90.0, 80.0, 8.0]])
    }

    #[test]
    fn all_targets_are_reached_together_by_ways_that_keep_clear() {
        let problem = six();
        let plan = plan(&problem).unwrap();
        assert_eq!((plan.journeys.len(), plan.left_out.len()), (6, 0));
        assert_eq!(plan.encounters, []);
        for target in 0..3 {
            assert!(plan.journeys.iter().any(|journey| journey.targets == [target]));
        }
        for journey in &plan.journeys {
            assert!(journey.assessment.is_feasible(), "{journey:?}");
            assert!((journey.slowed * journey.assessment.time_s - plan.arrival_s).abs() < 1e-9);
            for leg in journey.route.windows(2) {
                assert_eq!(
                    valley().intrusion_m(&leg[0], &leg[1]) + valley().outside_m(&leg[0], &leg[1], 1.0),
                    0.0
                );
            }
            let second = journey.second.as_ref().unwrap();
            assert!(second.by != journey.by && second.assessment.cost_m >= journey.assessment.cost_m);
        }
        assert_eq!(plan, super::plan(&problem).unwrap(), "the same seed gives the same plan");
    }

    #[test]
    fn few_vehicles_visit_many_targets_one_after_another() {
        let targets =
            [[20.0, 20.0, 8.0], [80.0, 20.0, 8.0], [20.0, 80.0, 8.0], [90.0, 40.0, 8.0], [50.0, 90.0, 8.0]];
        let flyers = vec![flyer(1, [5.0, 30.0, 5.0]), flyer(2, [5.0, 70.0, 5.0])];
        let plan = plan(&problem(valley(), flyers, &targets)).unwrap();
        let mut visited: Vec<_> = plan.journeys.iter().flat_map(|journey| journey.targets.clone()).collect();
        visited.sort_unstable();
        assert_eq!(visited, [0, 1, 2, 3, 4]);
        for journey in &plan.journeys {
            let passes = |at: [f64; 3]| journey.route.contains(&Vector3::from(at));
            assert!(journey.targets.iter().all(|number| passes(targets[*number])));
        }
    }

    #[test]
    fn one_goes_to_each_target_after_where_it_goes_anyway_and_the_others_fly_on() {
        let mut problem = six();
        problem.one_to_each = true;
        problem.targets = vec![Vector3::new(30.0, 90.0, 8.0)];
        for flyer in &mut problem.flyers {
            flyer.stops = vec![Vector3::new(90.0, flyer.position.y, 9.0)];
        }
        problem.others = (0..6)
            .map(|k| {
                let flyer = &problem.flyers[k];
                Other { node: flyer.node.clone(), way: vec![flyer.position, flyer.stops[0]] }
            })
            .collect();
        let plan = plan(&problem).unwrap();
        assert_eq!(plan.journeys.len(), 1);
        let journey = &plan.journeys[0];
        assert_eq!((journey.node.clone(), journey.targets.clone()), (node(6), vec![0]));
        let targets: Vec<_> = journey.sent().unwrap().targets().map(|(_, place)| place).collect();
        assert_eq!(targets, [[90.0, 80.0, 9.0], [30.0, 90.0, 8.0]]);
        assert_eq!(plan.encounters, []);
    }

    #[test]
    fn who_has_not_enough_in_its_battery_is_left_out_and_its_target_goes_to_another() {
        let flyers = vec![
            flyer(1, [5.0, 30.0, 5.0]),
            Flyer { battery: 0.15, ..flyer(2, [5.0, 70.0, 5.0]) },
            Flyer { battery: 0.21, ..flyer(3, [5.0, 90.0, 5.0]) },
        ];
        let mut problem = problem(valley(), flyers, &[[90.0, 30.0, 8.0], [90.0, 80.0, 8.0]]);
        problem.theatre.craft.endurance_s = 100.0;
        let plan = plan(&problem).unwrap();
        assert_eq!(plan.journeys.len(), 1);
        let why: Vec<_> = plan.left_out.iter().map(|left| left.why.as_str()).collect();
        assert_eq!(why[0], "has 15 % left in its battery");
        assert!(why[1].contains("its battery lasts for 21 s"), "{why:?}");
        assert_eq!(plan.journeys[0].targets.len(), 2);
    }

    #[test]
    fn targets_and_vehicles_that_cannot_be_planned_for_are_named_with_the_reason() {
        let fails =
            |targets: &[[f64; 3]], flyers| plan(&problem(valley(), flyers, targets)).unwrap_err().to_string();
        let one = || vec![flyer(1, [5.0, 30.0, 5.0])];
        assert!(fails(&[], one()).contains("no target"));
        assert!(fails(&[[9.0, 9.0, 9.0]; 65], one()).contains("65 targets"));
        assert!(
            fails(&[[90.0, 30.0, 8.0], [50.0, 40.0, 8.0]], one())
                .contains("target 2, (50.0, 40.0, 8.0), is in a zone")
        );
        assert!(
            fails(&[[90.0, 30.0, 1.8]], one()).contains("is 1.8 m above the ground: expected at least 2.0 m")
        );
        assert!(fails(&[[900.0, 30.0, 1.0]], one()).contains("is outside the air"));
        assert!(fails(&[[f64::NAN, 30.0, 1.0]], one()).contains("is outside the air"));
        assert!(fails(&[[90.0, 30.0, 8.0]], vec![]).contains("none is there"));
        let inside = vec![flyer(1, [70.0, 70.0, 5.0])];
        assert!(
            fails(&[[90.0, 30.0, 8.0]], inside)
                .contains("uav/1 is in a zone or a threat, or too near to one, where it is")
        );
    }

    #[test]
    fn a_vehicle_that_stands_in_the_way_is_gone_round_and_one_at_the_target_is_told() {
        let way = |at: [f64; 3]| vec![Vector3::from(at)];
        let mut problem =
            problem(Airspace::default(), vec![flyer(1, [5.0, 50.0, 5.0])], &[[90.0, 50.0, 5.0]]);
        problem.others = vec![Other { node: node(9), way: way([50.0, 50.0, 5.0]) }];
        assert_eq!(plan(&problem).unwrap().encounters, []);
        problem.others = vec![Other {
            node: node(9),
            way: vec![Vector3::new(90.0, 90.0, 5.0), Vector3::new(90.0, 52.0, 5.0)],
        }];
        match plan(&problem) {
            Ok(plan) => {
                assert_eq!(plan.encounters.len(), 1);
                assert_eq!(plan.encounters[0].who, ["uav/1", "uav/9"]);
                assert!((plan.encounters[0].distance_m - 2.0).abs() < 1e-6, "{:?}", plan.encounters);
            }
            Err(error) => assert!(error.to_string().contains("keeps clear of"), "{error}"),
        }
    }
}

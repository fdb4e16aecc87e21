//! A refuge: the nearest place where a vehicle is out of everybody's way.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use nalgebra::Vector3;

use super::astar::Disc;
use crate::map::ClearanceMap;
use crate::path::Path;
use crate::region::Region;

/// From one place that is looked at to the next, metres.
const STEP_M: f64 = 0.4;
/// The cost of a step along an axis, and across: seventeen to twelve is the diagonal of a square to its side.
const ALONG: u32 = 12;
const ACROSS: u32 = 17;
/// The way that a cost of one stands for, metres.
const COST_M: f64 = STEP_M / ALONG as f64;
/// A refuge with room around it is worth so much more of a way, metres.
const WORTH_M: f64 = 3.0;
/// Steps in a row of the eight directions: along an axis, and across.
const STEPS: [[i32; 2]; 8] = [[1, 0], [0, 1], [-1, 0], [0, -1], [1, 1], [-1, 1], [-1, -1], [1, -1]];

/// The one that looks for a refuge, and the one it makes way for. Metres, ENU.
#[derive(Clone, Copy, Debug)]
pub struct RefugeRequest<'a> {
    pub from: Vector3<f64>,
    /// The ways that are to be kept free.
    pub ways: &'a [&'a Path],
    /// From the refuge to each of these ways and to everybody who stands.
    pub keep_m: f64,
    /// Those who stand: the refuge is not beside them.
    pub standing: &'a [Vector3<f64>],
    /// Places not to fly through on the way there.
    pub discs: &'a [Disc],
    /// Clearance to obstacles, as far as there is so much.
    pub clearance_m: f64,
    /// The box that the way stays in.
    pub within: Region,
    /// Places looked at, at most.
    pub budget: usize,
}

/// The way to the nearest place, at the height of the start, that is `keep_m` away from the ways and those who stand;
/// `None` if none can be reached (Dijkstra 1959). One that has as much room to obstacles too may be further: there, way
/// can be made for those whose ways are not known yet.
pub fn refuge(map: &ClearanceMap, request: &RefugeRequest<'_>) -> Option<Path> {
    let place = |[x, y]: [i32; 2]| request.from + Vector3::new(f64::from(x), f64::from(y), 0.0) * STEP_M;
    let least_m = request.clearance_m.min(map.clearance(&request.from));
    let mut came_from: BTreeMap<[i32; 2], [i32; 2]> = BTreeMap::new();
    let mut costs: BTreeMap<[i32; 2], u32> = BTreeMap::from([([0, 0], 0)]);
    let mut open = BinaryHeap::from([(Reverse(0_u32), [0, 0])]);
    let mut tight: Option<([i32; 2], u32)> = None;
    let mut wide = None;
    for _ in 0..request.budget {
        let Some((Reverse(cost), cell)) = open.pop() else { break };
        if costs.get(&cell).is_some_and(|known| *known < cost) {
            continue;
        }
        if tight.is_some_and(|(_, tight)| f64::from(cost - tight) * COST_M > WORTH_M) {
            break;
        }
        let here = place(cell);
        if request.is_refuge(&here) {
            if map.clearance(&here) >= request.keep_m {
                wide = Some(cell);
                break;
            }
            tight = tight.or(Some((cell, cost)));
        }
        for step in STEPS {
            let next = [cell[0] + step[0], cell[1] + step[1]];
            let there = place(next);
            let total = cost + if step.contains(&0) { ALONG } else { ACROSS };
            let is_better = costs.get(&next).is_none_or(|known| total < *known);
            if is_better && request.may_go(&here, &there) && is_free(map, &here, &there, least_m) {
                costs.insert(next, total);
                came_from.insert(next, cell);
                open.push((Reverse(total), next));
            }
        }
    }
    let end = wide.or(tight.map(|(cell, _)| cell))?;
    let back = std::iter::successors(Some(end), |cell| came_from.get(cell).copied());
    let mut points: Vec<_> = back.map(place).collect();
    points.reverse();
    Path::new(points)
}

fn is_free(map: &ClearanceMap, from: &Vector3<f64>, to: &Vector3<f64>, least_m: f64) -> bool {
    map.clearance(to) >= least_m && map.is_open(from, to)
}

impl RefugeRequest<'_> {
    fn is_refuge(&self, place: &Vector3<f64>) -> bool {
        let is_off = |way: &&Path| way.project(&way_height(way, place)).distance_m >= self.keep_m;
        let is_alone = |other: &Vector3<f64>| (other - place).xy().norm() >= self.keep_m;
        self.ways.iter().all(is_off) && self.standing.iter().all(is_alone)
    }

    /// Whether a step leads into no disc; who is inside one may leave it.
    fn may_go(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        let depth_m = |disc: &Disc, place: &Vector3<f64>| disc.radius_m - (disc.centre - place).xy().norm();
        let is_no_deeper = |disc: &Disc| depth_m(disc, to) <= depth_m(disc, from).max(0.0);
        self.within.level_room_m(to) >= 0.0 && self.discs.iter().all(is_no_deeper)
    }
}

/// The place at the height of a way's beginning: who makes way does so sideways.
fn way_height(way: &Path, place: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(place.x, place.y, way.start().z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::VoxelMapConfig;

    const HEIGHT_M: f64 = 2.1;

    fn at(x: f64, y: f64) -> Vector3<f64> {
        Vector3::new(x, y, HEIGHT_M)
    }

    /// A corridor along x, 1.6 m wide from x = -10 to 10, with a side branch of 1.6 m at `branch_x`, if one is given.
    fn corridor(branch_x: Option<f64>) -> ClearanceMap {
        let mut map =
            ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, HEIGHT_M), 2.5).unwrap();
        map.track(HEIGHT_M);
        for k in -50..=50 {
            let x = f64::from(k) * 0.2;
            let is_open = branch_x.is_some_and(|branch_x| (x - branch_x).abs() < 0.8);
            if !is_open {
                map.insert(&at(x, 0.9));
            }
            map.insert(&at(x, -0.9));
        }
        if let Some(branch_x) = branch_x {
            for k in 0..=20 {
                let y = 0.9 + f64::from(k) * 0.2;
                map.insert(&at(branch_x - 0.9, y));
                map.insert(&at(branch_x + 0.9, y));
            }
        }
        map
    }

    fn request<'a>(from: Vector3<f64>, ways: &'a [&'a Path], discs: &'a [Disc]) -> RefugeRequest<'a> {
        RefugeRequest {
            from,
            ways,
            keep_m: 1.6,
            standing: &[],
            discs,
            clearance_m: 0.35,
            within: Region::EVERYWHERE,
            budget: 20_000,
        }
    }

    #[test]
    fn a_side_branch_behind_is_the_nearest_refuge() {
        let map = corridor(Some(4.0));
        let way = Path::new(vec![at(-4.0, 0.0), at(12.0, 0.0)]).unwrap();
        let way_there = refuge(&map, &request(at(0.0, 0.0), &[&way], &[])).unwrap();
        let end = way_there.end();
        assert!((end.x - 4.0).abs() < 0.6 && (1.6..2.4).contains(&end.y), "{end:?}");
    }

    #[test]
    fn without_one_it_is_outside_beside_the_way() {
        let map = corridor(None);
        let way = Path::new(vec![at(-4.0, 0.0), at(16.0, 0.0)]).unwrap();
        let who_comes = [Disc { centre: at(-4.0, 0.0), radius_m: 1.4 }];
        let end = refuge(&map, &request(at(0.0, 0.0), &[&way], &who_comes)).unwrap().end();
        assert!(end.x > 9.0 && end.y.abs() >= 1.6, "{end:?}");
    }

    #[test]
    fn who_is_between_two_is_cornered() {
        let map = corridor(None);
        let way = Path::new(vec![at(-4.0, 0.0), at(16.0, 0.0)]).unwrap();
        let discs = [-4.0, 3.0].map(|x| Disc { centre: at(x, 0.0), radius_m: 1.4 });
        assert_eq!(refuge(&map, &request(at(0.0, 0.0), &[&way], &discs)), None);
        assert!(refuge(&map, &request(at(0.0, 0.0), &[&way], &discs[..1])).is_some());
    }
}

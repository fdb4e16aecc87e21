//! Actors: people and others who walk through a world on ways of their own.

use std::time::Duration;

use nalgebra::{Isometry3, Vector3};

use super::error::SdfError;
use super::reader::Reader;
use super::stand::scoped;
use super::text::Element;
use crate::obstacle::{Obstacle, Shape};
use crate::way::Way;

/// A person, whether the origin is at the hip or at the feet: half of the height and the middle above the
/// origin, m.
const HALF_HEIGHT_M: f64 = 1.5;
const MIDDLE_M: f64 = 0.5;
const RADIUS_M: f64 = 0.4;

impl Reader<'_> {
    /// The solid that contains an actor, on its way; `None` of one that nothing is seen of.
    pub(super) fn read_actor(&mut self, actor: Element<'_>) -> Result<Option<Obstacle>, SdfError> {
        self.count(actor, 1)?;
        let name = actor.attribute("name").unwrap_or("actor");
        let pose = self.read_pose(actor)?;
        let mut reach: f64 = 0.0;
        for link in actor.children("link") {
            reach = reach.max(self.reach_of(link, name)?);
        }
        let (shape, lift) = match actor.child("skin").is_some() {
            true => {
                let half_height = HALF_HEIGHT_M.max(reach);
                (Shape::Cylinder { radius: RADIUS_M.max(reach), half_height }, Vector3::z() * MIDDLE_M)
            }
            false if reach > 0.0 => (Shape::Sphere { radius: reach }, Vector3::zeros()),
            false => {
                self.account.note(actor, format!("actor `{name}` has neither skin nor solid; left out"));
                return Ok(None);
            }
        };
        let start = Isometry3::from(pose.offset.translation.vector + lift);
        let person = Obstacle::new(scoped("", name), shape, start);
        let Some(way) = self.read_way(actor, lift)? else {
            if actor.child("plugin").is_some() {
                self.account
                    .refuse(actor, format!("actor `{name}` moves as a plugin says, which cannot be read"));
                return Ok(None);
            }
            self.account.honour(actor);
            return Ok(Some(person));
        };
        self.account.honour(actor);
        Ok(Some(person.on(way)))
    }

    /// Radius of the ball about the actor's origin that holds the solids of a link, m.
    fn reach_of(&mut self, link: Element<'_>, owner: &str) -> Result<f64, SdfError> {
        let offset = self.read_pose(link)?.offset;
        let mut reach: f64 = 0.0;
        for collision in link.children("collision") {
            let own = self.read_pose(collision)?.offset;
            let geometry = collision.required("geometry", "a <geometry>")?;
            for (shape, inner) in self.read_geometry(geometry, owner)? {
                let centre = (offset * own * inner).translation.vector;
                reach = reach.max(centre.norm() + shape.bounding_radius());
            }
        }
        Ok(if reach.is_finite() { reach } else { 0.0 })
    }

    /// The way through all waypoints of the script, in the order of their times.
    fn read_way(&mut self, actor: Element<'_>, lift: Vector3<f64>) -> Result<Option<Way>, SdfError> {
        let Some(script) = actor.child("script") else { return Ok(None) };
        let mut stops = Vec::new();
        for waypoint in script.children("trajectory").flat_map(|trajectory| trajectory.children("waypoint")) {
            self.count(waypoint, 1)?;
            let time = waypoint.required("time", "a time in seconds")?;
            let [seconds] = time.numbers::<1>("a time in seconds, not below 0")?;
            if seconds < 0.0 {
                return Err(time.bad_value("a time in seconds, not below 0"));
            }
            let at = waypoint.required("pose", "a <pose>")?.isometry()?.translation.vector + lift;
            stops.push((Duration::from_secs_f64(seconds), at));
        }
        stops.sort_by_key(|(time, _)| *time);
        let [delay_s] = script.child_numbers("delay_start", "seconds")?.unwrap_or([0.0]);
        let loops = script.flag("loop").unwrap_or(true);
        if script.flag("auto_start") == Some(false) {
            self.account.note(script, "<auto_start> is off; the actor walks from the beginning all the same");
        }
        Ok((!stops.is_empty()).then(|| Way::timed(&stops, Duration::from_secs_f64(delay_s.max(0.0)), loops)))
    }
}

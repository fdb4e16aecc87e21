//! Models, with their links, frames and solids.

use super::error::SdfError;
use super::reader::Reader;
use super::text::Element;
use super::tree::{Body, Frame, Link, Model, Pose, Reference};

/// Children of a link that do not change where it is safe to fly.
const LINK_TRIMMINGS: [&str; 17] = [
    "audio_sink",
    "audio_source",
    "battery",
    "collision_cloud",
    "enable_wind",
    "gravity",
    "inertial",
    "kinematic",
    "light",
    "must_be_base_link",
    "particle_emitter",
    "plugin",
    "projector",
    "self_collide",
    "sensor",
    "velocity_decay",
    "visual",
];
const COLLISION_TRIMMINGS: [&str; 6] =
    ["auto_inertia_params", "density", "laser_retro", "max_contacts", "surface", "material"];
const MODEL_TRIMMINGS: [&str; 7] =
    ["allow_auto_disable", "enable_wind", "gripper", "self_collide", "light", "model_config", "description"];

impl Reader<'_> {
    /// Reads a model; `is_static` if what holds it is.
    pub(super) fn read_model(
        &mut self,
        element: Element<'_>,
        is_static: bool,
        depth: usize,
    ) -> Result<Model, SdfError> {
        self.check_depth(element, depth)?;
        self.count(element, 1)?;
        self.account.honour(element);
        let mut model = Model {
            name: element.attribute("name").unwrap_or("model").to_owned(),
            is_static: element.flag("static").unwrap_or(is_static),
            pose: self.read_pose(element)?,
            placement: element.attribute("placement_frame").map(|frame| refer(element, frame)),
            ..Model::default()
        };
        for child in element.elements() {
            self.read_part(child, &mut model, depth)?;
        }
        Ok(model)
    }

    fn read_part(&mut self, child: Element<'_>, model: &mut Model, depth: usize) -> Result<(), SdfError> {
        match child.name() {
            "link" => {
                let link = self.read_link(child)?;
                model.links.push(link);
            }
            "frame" => {
                let frame = self.read_frame(child, child.attribute("attached_to"))?;
                model.frames.push(frame);
            }
            "joint" => {
                let held = child.child_text("child").filter(|held| !held.is_empty());
                let joint = self.read_frame(child, held)?;
                model.frames.push(joint);
            }
            "model" => {
                let inner = self.read_model(child, model.is_static, depth + 1)?;
                model.models.push(inner);
            }
            "include" => {
                let inner = self.read_include(child, model.is_static, depth + 1)?;
                model.models.extend(inner);
            }
            "static" => self.account.honour(child),
            "pose" => {}
            "plugin" => self.pass_plugin(child),
            name if MODEL_TRIMMINGS.contains(&name) => self.account.pass(child),
            _ => self.account.pass_unknown(child),
        }
        Ok(())
    }

    /// The effect of a plugin is not known; one that moves a model is named.
    pub(super) fn pass_plugin(&mut self, plugin: Element<'_>) {
        let words = [plugin.attribute("filename"), plugin.attribute("name")];
        let words: String = words.into_iter().flatten().collect::<String>().to_lowercase();
        let moves = ["animated", "trajectory", "mover", "actor", "velocity-control", "velocitycontrol"];
        match moves.iter().any(|word| words.contains(word)) {
            true => self.account.note(plugin, "a plugin moves this in Gazebo; it stands still here"),
            false => self.account.pass(plugin),
        }
    }

    fn read_link(&mut self, element: Element<'_>) -> Result<Link, SdfError> {
        self.count(element, 1)?;
        self.account.honour(element);
        let name = element.attribute("name").unwrap_or("link").to_owned();
        let mut link = Link { name, pose: self.read_pose(element)?, bodies: Vec::new() };
        let mut is_solid = false;
        for child in element.elements() {
            match child.name() {
                "collision" => {
                    is_solid = true;
                    self.read_collision(child, &mut link)?;
                }
                "pose" => {}
                name if LINK_TRIMMINGS.contains(&name) => self.account.pass(child),
                _ => self.account.pass_unknown(child),
            }
        }
        if !is_solid && element.child("visual").is_some() {
            let note = format!("link `{}` can be seen but has no <collision>; left out", link.name);
            self.account.note(element, note);
        }
        Ok(link)
    }

    fn read_collision(&mut self, element: Element<'_>, link: &mut Link) -> Result<(), SdfError> {
        let name = element.attribute("name").unwrap_or("collision");
        let pose = self.read_pose(element)?;
        let geometry = element.required("geometry", "a <geometry>")?;
        let owner = format!("{}::{name}", link.name);
        let solids = self.read_geometry(geometry, &owner)?;
        if !solids.is_empty() {
            self.account.honour(element);
        }
        self.count(element, solids.len())?;
        link.bodies.extend(solids.into_iter().map(|(shape, offset)| {
            let pose = Pose { offset: pose.offset * offset, ..pose.clone() };
            Body { name: name.to_owned(), pose, shape }
        }));
        for child in element.elements() {
            match child.name() {
                "geometry" | "pose" => {}
                name if COLLISION_TRIMMINGS.contains(&name) => self.account.pass(child),
                _ => self.account.pass_unknown(child),
            }
        }
        Ok(())
    }

    /// A frame or joint, relative to what it is attached to.
    pub(super) fn read_frame(
        &mut self,
        element: Element<'_>,
        attached_to: Option<&str>,
    ) -> Result<Frame, SdfError> {
        self.count(element, 1)?;
        self.account.honour(element);
        Ok(Frame {
            name: element.attribute("name").unwrap_or_default().to_owned(),
            attached_to: attached_to.map(|frame| refer(element, frame)),
            pose: self.read_pose(element)?,
        })
    }

    /// The pose of an element.
    pub(super) fn read_pose(&mut self, owner: Element<'_>) -> Result<Pose, SdfError> {
        let Some(pose) = owner.child("pose") else { return Ok(Pose::default()) };
        self.account.honour(pose);
        let frame = pose.attribute("relative_to").or(pose.attribute("frame"));
        Ok(Pose { relative_to: frame.map(|frame| refer(pose, frame)), offset: pose.isometry()? })
    }
}

pub(super) fn refer(element: Element<'_>, frame: &str) -> Reference {
    Reference { frame: frame.to_owned(), place: element.place() }
}

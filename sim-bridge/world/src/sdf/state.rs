//! `<state>`: where things are in a world that was saved while it ran.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Vector3};

use super::error::SdfError;
use super::reader::Reader;
use super::text::Element;
use super::tree::Model;

/// The state of a world, model or link, and of what it holds.
#[derive(Debug)]
pub(super) struct State {
    /// In the world; `None` of one that is where it was.
    pub pose: Option<Isometry3<f64>>,
    pub scale: Vector3<f64>,
    pub links: BTreeMap<String, State>,
    pub models: BTreeMap<String, State>,
}

impl Default for State {
    fn default() -> Self {
        Self { pose: None, scale: Vector3::repeat(1.0), links: BTreeMap::new(), models: BTreeMap::new() }
    }
}

impl Reader<'_> {
    /// Reads the states of the world's models into `state`, and takes and gives models as it says.
    pub(super) fn read_state(
        &mut self,
        element: Element<'_>,
        world: &mut Model,
        state: &mut State,
    ) -> Result<(), SdfError> {
        self.account.honour(element);
        for child in element.elements() {
            match child.name() {
                "model" => {
                    let own = self.read_model_state(child, 0)?;
                    state.models.insert(child.attribute("name").unwrap_or_default().to_owned(), own);
                }
                "insertions" => {
                    self.account.honour(child);
                    for model in child.children("model") {
                        let model = self.read_model(model, false, 1)?;
                        world.models.push(model);
                    }
                }
                "deletions" => {
                    self.account.honour(child);
                    let gone: Vec<_> = child.children("name").map(|name| name.text()).collect();
                    world.models.retain(|model| !gone.contains(&model.name.as_str()));
                }
                "sim_time" | "wall_time" | "real_time" | "iterations" | "light" => self.account.pass(child),
                _ => self.account.pass_unknown(child),
            }
        }
        Ok(())
    }

    fn read_model_state(&mut self, element: Element<'_>, depth: usize) -> Result<State, SdfError> {
        self.check_depth(element, depth)?;
        self.account.honour(element);
        let mut state = State::default();
        for child in element.elements() {
            let name = child.attribute("name").unwrap_or_default().to_owned();
            match child.name() {
                "pose" => state.pose = Some(child.isometry()?),
                "scale" => state.scale = child.numbers::<3>("three factors above 0")?.into(),
                "link" => {
                    let link = self.read_model_state(child, depth + 1)?;
                    state.links.insert(name, link);
                }
                "model" => {
                    let model = self.read_model_state(child, depth + 1)?;
                    state.models.insert(name, model);
                }
                "velocity" | "acceleration" | "wrench" | "joint" | "collision" => self.account.pass(child),
                _ => self.account.pass_unknown(child),
            }
            if state.scale.min() <= 0.0 {
                return Err(child.bad_value("three factors above 0"));
            }
        }
        Ok(state)
    }
}

//! Where everything stands: the frames of a world, each relative to another.

use std::collections::HashMap;

use nalgebra::Isometry3;

use super::error::SdfError;
use super::place::Place;
use super::tree::{Model, Pose, Reference};

/// The frames of a world, by number; 0 is the world itself.
pub(super) struct Frames<'m> {
    frames: Vec<Node<'m>>,
    /// By the number of the model that holds it, and its name.
    numbers: HashMap<(usize, &'m str), usize>,
    offsets: Vec<Option<Isometry3<f64>>>,
    poses: Vec<Option<Isometry3<f64>>>,
}

struct Node<'m> {
    /// The number of the model that holds it.
    scope: usize,
    pose: &'m Pose,
    /// The frame of its pose where that does not say.
    attached_to: Option<&'m Reference>,
    placement: Option<&'m Reference>,
    /// Models in it whose parts count as its own.
    merged: Vec<usize>,
}

impl<'m> Frames<'m> {
    pub(super) fn new(world: &'m Model) -> Self {
        let mut frames =
            Self { frames: Vec::new(), numbers: HashMap::new(), offsets: Vec::new(), poses: Vec::new() };
        frames.add_model(world, 0);
        frames.offsets = vec![None; frames.frames.len()];
        frames.poses = vec![None; frames.frames.len()];
        if let (Some(offset), Some(pose)) = (frames.offsets.first_mut(), frames.poses.first_mut()) {
            (*offset, *pose) = (Some(Isometry3::identity()), Some(Isometry3::identity()));
        }
        frames
    }

    fn add(&mut self, name: &'m str, node: Node<'m>) -> usize {
        let number = self.frames.len();
        self.numbers.entry((node.scope, name)).or_insert(number);
        self.frames.push(node);
        number
    }

    /// Numbers a model, its frames and links in turn, and its models: whoever puts them up counts on that
    /// order.
    fn add_model(&mut self, model: &'m Model, scope: usize) {
        let node = Node {
            scope,
            pose: &model.pose,
            attached_to: None,
            placement: model.placement.as_ref(),
            merged: Vec::new(),
        };
        let scope = self.add(&model.name, node);
        let part = |pose, attached_to| Node { scope, pose, attached_to, placement: None, merged: Vec::new() };
        for frame in &model.frames {
            self.add(&frame.name, part(&frame.pose, frame.attached_to.as_ref()));
        }
        for link in &model.links {
            self.add(&link.name, part(&link.pose, None));
        }
        for child in &model.models {
            let number = self.frames.len();
            self.add_model(child, scope);
            if let Some(node) = self.frames.get_mut(scope).filter(|_| child.is_merged) {
                node.merged.push(number);
            }
        }
    }

    /// The number of the frame that a reference in model `scope` means.
    fn find(&self, scope: usize, reference: &Reference) -> Result<usize, SdfError> {
        let root = || matches!(reference.frame.as_str(), "world" | "__root__").then_some(0);
        self.find_path(scope, &reference.frame).or_else(root).ok_or_else(|| SdfError::NoFrame {
            place: reference.place.clone(),
            frame: reference.frame.chars().take(80).collect(),
        })
    }

    fn find_path(&self, scope: usize, path: &str) -> Option<usize> {
        if path == "__model__" {
            return Some(scope);
        }
        if let Some(number) = self.numbers.get(&(scope, path)).filter(|number| **number != 0) {
            return Some(*number);
        }
        let merged = self.frames.get(scope)?.merged.iter();
        if let Some(number) = merged.filter_map(|inner| self.find_path(*inner, path)).next() {
            return Some(number);
        }
        let (first, rest) = path.split_once("::")?;
        let inner = self.find_path(scope, first).filter(|inner| *inner != scope)?;
        self.find_path(inner, rest)
    }

    /// The number of the frame that a pose in model `scope` is relative to.
    fn base(&self, scope: usize, pose: &Pose, usual: usize) -> Result<usize, SdfError> {
        pose.relative_to.as_ref().map_or(Ok(usual), |reference| self.find(scope, reference))
    }

    fn base_of(&self, number: usize) -> Result<usize, SdfError> {
        let Some(node) = self.frames.get(number) else { return Ok(0) };
        match (&node.pose.relative_to, node.attached_to) {
            (Some(reference), _) | (None, Some(reference)) => self.find(node.scope, reference),
            (None, None) => Ok(node.scope),
        }
    }

    /// The pose of a frame relative to the one that its own pose is relative to.
    fn offset(&mut self, number: usize) -> Result<Isometry3<f64>, SdfError> {
        if let Some(Some(offset)) = self.offsets.get(number) {
            return Ok(*offset);
        }
        let Some(node) = self.frames.get(number) else { return Ok(Isometry3::identity()) };
        let mut offset = node.pose.offset;
        if let Some(placement) = node.placement {
            offset *= self.within(placement, number)?.inverse();
        }
        if let Some(known) = self.offsets.get_mut(number) {
            *known = Some(offset);
        }
        Ok(offset)
    }

    /// The pose of the frame that is meant in model `scope`, relative to that model.
    fn within(&mut self, placement: &Reference, scope: usize) -> Result<Isometry3<f64>, SdfError> {
        let mut pose = Isometry3::identity();
        let mut number = self.find(scope, placement)?;
        for _ in 0..self.frames.len() {
            if number == scope {
                return Ok(pose);
            }
            if number == 0 {
                break;
            }
            pose = self.offset(number)? * pose;
            number = self.base_of(number)?;
        }
        Err(circle(placement))
    }

    /// The pose of a frame in the world.
    pub(super) fn pose(&mut self, number: usize) -> Result<Isometry3<f64>, SdfError> {
        let mut way = Vec::new();
        let mut at = number;
        let base = loop {
            if let Some(Some(known)) = self.poses.get(at) {
                break *known;
            }
            way.push(at);
            if way.len() > self.frames.len() {
                return Err(self.circle_at(number));
            }
            at = self.base_of(at)?;
        };
        let mut pose = base;
        for number in way.into_iter().rev() {
            pose *= self.offset(number)?;
            if let Some(known) = self.poses.get_mut(number) {
                *known = Some(pose);
            }
        }
        Ok(pose)
    }

    fn circle_at(&self, number: usize) -> SdfError {
        let mut at = number;
        loop {
            let node = self.frames.get(at);
            let reference = node.and_then(|node| node.pose.relative_to.as_ref().or(node.attached_to));
            match (reference, self.base_of(at)) {
                (Some(reference), _) => return circle(reference),
                (None, Ok(base)) if base != at => at = base,
                _ => {
                    let place = Place { source_name: "".into(), line: 0, column: 0 };
                    return circle(&Reference { frame: String::new(), place });
                }
            }
        }
    }

    /// The pose in the world of something in link `link` of model `scope`.
    pub(super) fn pose_in_link(
        &mut self,
        scope: usize,
        link: usize,
        pose: &Pose,
    ) -> Result<Isometry3<f64>, SdfError> {
        let base = self.base(scope, pose, link)?;
        Ok(self.pose(base)? * pose.offset)
    }

    /// The number of the first link of model `number`.
    pub(super) fn first_link(number: usize, model: &Model) -> usize {
        number + 1 + model.frames.len()
    }
}

fn circle(reference: &Reference) -> SdfError {
    SdfError::Circle { place: reference.place.clone(), frame: reference.frame.chars().take(80).collect() }
}

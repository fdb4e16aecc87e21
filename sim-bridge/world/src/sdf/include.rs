//! `<include>`: models in files of their own.

use super::error::SdfError;
use super::model::refer;
use super::reader::Reader;
use super::text::{Element, Source};
use super::tree::Model;
use crate::files::Found;

/// Models that every Gazebo has, and that bring no obstacle.
const BUILT_IN_MODELS: [&str; 2] = ["sun", "ground_plane"];

impl Reader<'_> {
    /// Reads an included model under the name and at the pose that it is given; `None` if it is refused, or
    /// no model.
    pub(super) fn read_include(
        &mut self,
        include: Element<'_>,
        is_static: bool,
        depth: usize,
    ) -> Result<Option<Model>, SdfError> {
        self.check_depth(include, depth)?;
        let uri = include.required("uri", "a <uri>")?.text();
        for child in include.elements() {
            match child.name() {
                "uri" | "name" | "pose" | "static" | "placement_frame" => {}
                "plugin" => self.pass_plugin(child),
                "params" => {
                    self.account
                        .refuse(child, format!("the changes to included model `{uri}` cannot be read"));
                }
                _ => self.account.pass_unknown(child),
            }
        }
        let Some(model) = self.read_included(include, uri, depth)? else { return Ok(None) };
        self.account.honour(include);
        self.count(include, model.parts())?;
        Ok(Some(self.as_asked(include, model, is_static)?))
    }

    /// The model with what the including element puts in place of its own.
    fn as_asked(
        &mut self,
        include: Element<'_>,
        mut model: Model,
        is_static: bool,
    ) -> Result<Model, SdfError> {
        if let Some(name) = include.child_text("name").filter(|name| !name.is_empty()) {
            name.clone_into(&mut model.name);
        }
        model.is_static = include.flag("static").unwrap_or(model.is_static || is_static);
        if include.child("pose").is_some() {
            model.pose = self.read_pose(include)?;
        }
        if let Some(frame) = include.child("placement_frame").filter(|frame| !frame.text().is_empty()) {
            model.placement = Some(refer(frame, frame.text()));
        }
        model.is_merged = include.attribute("merge").is_some_and(|merge| matches!(merge, "1" | "true"));
        Ok(model)
    }

    fn read_included(
        &mut self,
        include: Element<'_>,
        uri: &str,
        depth: usize,
    ) -> Result<Option<Model>, SdfError> {
        let found = match self.files.open(uri, include.file()) {
            Found::Folder { name } => {
                let inside = self.main_file(&name);
                match self.files.open(&inside, &inside) {
                    Found::Missing | Found::Folder { .. } => {
                        Found::Unreadable(format!("there is no `{inside}`"))
                    }
                    found => found,
                }
            }
            found => found,
        };
        match found {
            Found::File { name, bytes } => self.read_model_file(include, &name, &bytes, depth),
            Found::Missing if built_in(uri).is_some() => {
                self.has_ground |= built_in(uri) == Some("ground_plane");
                self.account.honour(include);
                Ok(None)
            }
            Found::Unreadable(why) => {
                self.account.refuse(include, format!("included model `{uri}` cannot be read: {why}"));
                Ok(None)
            }
            Found::Missing | Found::Folder { .. } => {
                self.account.refuse(include, format!("included model `{uri}` is not there"));
                Ok(None)
            }
        }
    }

    /// The file of a model's folder that its `model.config` names, for the newest version of the format.
    fn main_file(&self, folder: &str) -> String {
        let config = format!("{folder}/model.config");
        let Found::File { bytes, .. } = self.files.open(&config, &config) else {
            return format!("{folder}/model.sdf");
        };
        let text = String::from_utf8_lossy(&bytes);
        let newest = Source::new(&config, &text).read(|config| {
            let version = |sdf: &Element<'_>| sdf.attribute("version").and_then(|it| it.parse::<f64>().ok());
            let newest = config
                .children("sdf")
                .filter(|sdf| !sdf.text().is_empty())
                .max_by(|a, b| version(a).unwrap_or_default().total_cmp(&version(b).unwrap_or_default()));
            Ok(newest.map(|sdf| sdf.text().to_owned()))
        });
        format!("{folder}/{}", newest.ok().flatten().unwrap_or_else(|| "model.sdf".to_owned()))
    }

    fn read_model_file(
        &mut self,
        include: Element<'_>,
        name: &str,
        bytes: &[u8],
        depth: usize,
    ) -> Result<Option<Model>, SdfError> {
        if let Some(known) = self.models.get(name) {
            return Ok(Some(known.clone()));
        }
        let text = String::from_utf8_lossy(bytes);
        let model = Source::new(name, &text).read(|root| match root.child("model") {
            Some(model) if root.name() == "sdf" => self.read_model(model, false, depth).map(Some),
            _ => {
                self.read_no_model(include, root);
                Ok(None)
            }
        })?;
        if let Some(model) = &model {
            self.models.insert(name.to_owned(), model.clone());
        }
        Ok(model)
    }

    /// A file without a model: a light does not matter, all else may.
    fn read_no_model(&mut self, include: Element<'_>, root: Element<'_>) {
        if root.name() == "sdf" && root.elements().all(|child| child.name() == "light") {
            self.account.pass(include);
        } else {
            let why = format!("included file `{}` is no model in SDF", root.file());
            self.account.refuse(include, why);
        }
    }
}

/// The name of a model that every Gazebo has.
fn built_in(uri: &str) -> Option<&'static str> {
    let last = uri.trim_end_matches('/').rsplit('/').next()?.to_lowercase().replace(' ', "_");
    BUILT_IN_MODELS.into_iter().find(|name| *name == last)
}

//! The grants of a home: which nodes may request and block which of its events (G7).

use serde::Deserialize;
use skein_bp::{Event, EventSet, Pattern};

use crate::name::NodeName;

/// First part of the name of a b-thread that is a script: it needs the rights of its node and those of scripts.
pub const SCRIPT: &str = "script/";

/// The events of a home that somebody may request and block.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Grant {
    pub request: EventSet,
    pub block: EventSet,
}

/// A kind of node, and the grant of all its nodes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Role {
    /// Its name, such as `vehicle` or `operator`.
    pub name: String,
    pub nodes: Vec<Pattern>,
    pub grant: Grant,
}

/// The rights that a home grants to the b-threads of other nodes.
///
/// A node has the rights of all its roles together; one without a role has none. A home's own safety events and facts
/// are out of everybody's reach, whatever is granted here.
///
/// ```
/// use skein_bp::EventSet;
/// use skein_dbp::{Authority, Grant, NodeName, Role};
/// let ground = Role {
///     name: "ground".into(),
///     nodes: vec!["ground/*".into()],
///     grant: Grant { request: "uav/*/takeoff".into(), block: "uav/*/advance".into() },
/// };
/// let authority = Authority::new(vec![ground], None);
/// let (ground, uav) = (NodeName::new("ground/main")?, NodeName::new("uav/2")?);
/// assert!(authority.may_request(&ground, "launch", &"uav/1/takeoff".into()));
/// assert!(!authority.may_request(&uav, "launch", &"uav/1/takeoff".into()));
/// assert!(!authority.may_block(&ground, "hold all", &EventSet::from("uav/1/**")));
/// # Ok::<(), skein_dbp::NodeNameError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(from = "Vec<RoleTable>")]
pub struct Authority {
    roles: Vec<Role>,
    /// The most that scripts may do; none: what their node may.
    scripts: Option<Grant>,
}

impl Authority {
    /// Only what these roles grant; `scripts` limits b-threads that are scripts further.
    pub fn new(roles: Vec<Role>, scripts: Option<Grant>) -> Self {
        Self { roles, scripts }
    }

    /// Every member may request and block everything.
    pub fn unrestricted() -> Self {
        let all = Grant { request: EventSet::All, block: EventSet::All };
        Self::new(vec![Role { name: "member".into(), nodes: vec!["**".into()], grant: all }], None)
    }

    pub fn roles(&self) -> &[Role] {
        &self.roles
    }

    /// The most that scripts may do, if that is less than their node.
    pub fn scripts(&self) -> Option<&Grant> {
        self.scripts.as_ref()
    }

    pub fn may_request(&self, node: &NodeName, bthread: &str, event: &Event) -> bool {
        self.grants(node).any(|grant| grant.request.contains(event))
            && self.limit(bthread).is_none_or(|limit| limit.request.contains(event))
    }

    /// Whether `bthread` of `node` may block all of `set`, judged so that doubt means no.
    pub fn may_block(&self, node: &NodeName, bthread: &str, set: &EventSet) -> bool {
        let granted = EventSet::any_of(self.grants(node).map(|grant| &grant.block));
        set.is_within(&granted) && self.limit(bthread).is_none_or(|limit| set.is_within(&limit.block))
    }

    fn grants<'a>(&'a self, node: &'a NodeName) -> impl Iterator<Item = &'a Grant> {
        let has = |role: &&Role| role.nodes.iter().any(|pattern| pattern.matches(node.as_str()));
        self.roles.iter().filter(has).map(|role| &role.grant)
    }

    fn limit(&self, bthread: &str) -> Option<&Grant> {
        self.scripts.as_ref().filter(|_| bthread.starts_with(SCRIPT))
    }
}

/// A role as it is written in a file. One without `nodes` limits scripts.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RoleTable {
    role: String,
    #[serde(default)]
    nodes: Vec<String>,
    #[serde(default)]
    request: Vec<String>,
    #[serde(default)]
    block: Vec<String>,
}

impl From<Vec<RoleTable>> for Authority {
    fn from(tables: Vec<RoleTable>) -> Self {
        let (mut roles, mut scripts) = (Vec::new(), None);
        for RoleTable { role: name, nodes, request, block } in tables {
            let grant = Grant { request: EventSet::any_of(request), block: EventSet::any_of(block) };
            if nodes.is_empty() {
                let Grant { request, block } = scripts.take().unwrap_or_default();
                scripts = Some(Grant { request: request.or(grant.request), block: block.or(grant.block) });
            } else {
                roles.push(Role { name, nodes: nodes.into_iter().map(Pattern::new).collect(), grant });
            }
        }
        Self::new(roles, scripts)
    }
}

impl Default for Authority {
    fn default() -> Self {
        Self::unrestricted()
    }
}

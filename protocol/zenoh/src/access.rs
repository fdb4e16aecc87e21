//! Zenoh's access control, written from the roster: what the holder of each certificate may say and hear (G7).
//!
//! Whatever is not allowed here is denied, in both directions and on every link: also to a link whose other end has no
//! name that could be read.

use serde_json::{Value, json};
use skein_wire::{Fleet, Key, NodeName};

use crate::roster::Roster;

/// The value of Zenoh's setting `access_control`.
///
/// A member puts under its own name and listens to what is for it or for all. Nobody answers or asks queries, deletes,
/// or watches for signs of life. Who relays also passes on what any member says, to whom it is for.
pub(crate) fn control(fleet: &Fleet, roster: &Roster) -> Value {
    let all = Key::of_fleet(fleet);
    let members: Vec<&NodeName> = roster.members().map(|(node, _)| node).collect();
    let mut rules = vec![
        rule("hear who listens", "declare_subscriber", "egress", vec![all.clone()]),
        rule("be told all", "put", "egress", vec![all]),
        rule("pass on", "put", "ingress", members.iter().map(|member| Key::said_by(fleet, member)).collect()),
        rule(
            "listen for all",
            "declare_subscriber",
            "ingress",
            members.iter().flat_map(|member| Key::audible(fleet, member)).collect(),
        ),
    ];
    let (mut subjects, mut policies) = (Vec::new(), Vec::new());
    for member in members {
        let [says, listens, is_told] = ["says", "listens", "is told"].map(|what| format!("{member} {what}"));
        let audible = Key::audible(fleet, member);
        rules.extend([
            rule(&says, "put", "ingress", vec![Key::said_by(fleet, member)]),
            rule(&listens, "declare_subscriber", "ingress", audible.clone()),
            rule(&is_told, "put", "egress", audible),
        ]);
        subjects.push(json!({
            "id": member.as_str(),
            "cert_common_names": roster.common_names(member),
            "link_protocols": ["tls"],
        }));
        let mut may = vec![says, listens, is_told, "hear who listens".into()];
        if roster.relays(member) {
            may.extend(["be told all", "pass on", "listen for all"].map(String::from));
        }
        policies.push(json!({ "subjects": [member.as_str()], "rules": may }));
    }
    json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    })
}

fn rule(id: &str, message: &str, flow: &str, key_exprs: Vec<String>) -> Value {
    json!({
        "id": id,
        "permission": "allow",
        "messages": [message],
        "flows": [flow],
        "key_exprs": key_exprs,
    })
}

//! Scripts that a hostile operator sends: sound in form, and as much as fits in one, or more.

use serde_json::{Value, json};

/// Numbers that are long when they are written out.
const POINT: [f64; 3] = [-123_456.789_012_345, -123_456.789_012_345, -123_456.789_012_345];
/// The most points of a route.
const MOST_POINTS: usize = 32;

/// A script of this body as text.
pub fn text(name: &str, body: Value) -> String {
    let route = json!({ "about": "A route.", "type": "route", "default": vec![POINT; MOST_POINTS] });
    // Who ends at once is short.
    let parameters = if body == that_ends_at_once() { json!({}) } else { json!({ "r": route }) };
    let script = json!({ "name": name, "about": "Hostile.", "parameters": parameters, "body": body });
    json!({ "script": script }).to_string()
}

pub fn that_ends_at_once() -> Value {
    let order = json!({ "name": "{me}/order", "data": { "what": "resume", "by": "script/{name}" } });
    json!([{ "sync": { "request": order } }])
}

/// It waits for so many events.
pub fn of_many_events(count: usize) -> Value {
    let names: Vec<String> = (0..count).map(|number| format!("e/{number}")).collect();
    json!([{ "sync": { "wait": names } }])
}

/// Sets inside others at each point of the route, about twelve times as many as `count`.
pub fn of_many_sets(count: usize) -> Value {
    let deep = (0..11).fold(json!("e/1"), |inner, _| json!({ "not": inner }));
    let at_each = vec![deep; count / MOST_POINTS];
    json!([{ "each": "r", "as": "p", "do": [{ "sync": { "wait": at_each } }] }])
}

/// Events with the whole route in each as a text, about 30 KB long; so many as `count` has 25s.
pub fn that_becomes_long(count: usize) -> Value {
    let written = format!(" {}", "{r}".repeat(15));
    let ask = json!({ "sync": { "request": { "name": "{me}/order", "data": { "what": written } } } });
    Value::from(vec![ask; count / 25])
}

#[cfg(test)]
mod tests {
    use skein_bp::Bound;
    use skein_bp::script::Assignment;

    use super::*;

    fn bound(body: Value) -> Result<(), String> {
        let assignment = Assignment::from_json(&text("s1", body)).map_err(|error| error.to_string())?;
        assignment.bind("uav/1").map(|_| ()).map_err(|error| error.to_string())
    }

    #[test]
    fn each_kind_is_sound_until_it_is_beyond_its_bound() {
        assert_eq!(bound(that_ends_at_once()), Ok(()));
        assert_eq!(bound(of_many_events(390)), Ok(()));
        assert_eq!(bound(of_many_sets(100)), Ok(()));
        assert_eq!(bound(that_becomes_long(100)), Ok(()));
        for (body, limit) in
            [(of_many_sets(380), Bound::ScriptNodes), (that_becomes_long(380), Bound::ScriptBytes)]
        {
            let refusal = bound(body).unwrap_err();
            assert!(refusal.contains(limit.word()), "{refusal}");
        }
    }
}

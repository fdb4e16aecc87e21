//! Patterns over event names.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use crate::event::Event;
use crate::scope::{Level, NameKeys, Scope, leading_chunks};

/// A pattern over the chunks of a name: `*` stands for one chunk, `**` for any number of them, none included.
///
/// ```
/// use skein_bp::Pattern;
/// assert!(Pattern::new("uav/*/takeoff").matches("uav/3/takeoff"));
/// assert!(Pattern::new("uav/3/**").matches("uav/3/battery/low"));
/// assert!(!Pattern::new("uav/*").matches("uav/3/takeoff"));
/// ```
#[derive(Clone)]
pub struct Pattern(Arc<Parsed>);

struct Parsed {
    text: Arc<str>,
    wild: bool,
    /// The beginning of all names that fit, before the first star; all of a literal name.
    level: Level,
    fixed: usize,
    /// The hash of that.
    key: u64,
}

impl Pattern {
    /// Reads a pattern; every text is one.
    pub fn new(text: impl Into<Arc<str>>) -> Self {
        let text = text.into();
        let wild = text.split('/').any(is_star);
        Self::parsed(text, wild)
    }

    /// The pattern of exactly this name, even if the name has a chunk `*`.
    pub fn literal(name: impl Into<Arc<str>>) -> Self {
        Self::parsed(name.into(), false)
    }

    fn parsed(text: Arc<str>, wild: bool) -> Self {
        let scope = if wild { fixed_part(&text) } else { Scope::name(&text, &NameKeys::of(&text)) };
        let Scope { level, text: fixed, key } = scope;
        let fixed = fixed.len();
        Self(Arc::new(Parsed { text, wild, level, fixed, key }))
    }

    /// The pattern as written.
    pub fn as_str(&self) -> &str {
        &self.0.text
    }

    /// Whether the pattern stands for one name only.
    pub fn is_literal(&self) -> bool {
        !self.0.wild
    }

    /// Whether `name` fits the pattern.
    pub fn matches(&self, name: &str) -> bool {
        if !self.0.wild {
            return *self.0.text == *name;
        }
        chunks_match(&self.0.text, name)
    }

    /// Whether every name that fits this pattern surely fits `other` too.
    pub fn is_within(&self, other: &Pattern) -> bool {
        match (self.0.wild, other.0.wild) {
            (false, _) => other.matches(&self.0.text),
            (true, false) => false,
            (true, true) => chunks_within(&self.0.text, &other.0.text),
        }
    }

    /// Whether surely no name fits both patterns.
    pub(crate) fn is_apart_from(&self, other: &Pattern) -> bool {
        match (self.0.wild, other.0.wild) {
            (false, _) => !other.matches(&self.0.text),
            (true, false) => !self.matches(&other.0.text),
            (true, true) => !chunks_meet(Some(&self.0.text), Some(&other.0.text)),
        }
    }

    /// The part of every fitting name that is known: up to the first wildcard.
    pub(crate) fn fixed_start(&self) -> &str {
        if !self.0.wild {
            return &self.0.text;
        }
        let mut end = 0;
        for chunk in self.0.text.split_inclusive('/') {
            if matches!(chunk.trim_end_matches('/'), "*" | "**") {
                break;
            }
            end += chunk.len();
        }
        self.0.text.get(..end).unwrap_or_default()
    }

    pub(crate) fn matches_event(&self, event: &Event) -> bool {
        if self.0.wild {
            self.matches(event.name())
        } else {
            self.0.key == event.keys().name && *self.0.text == *event.name()
        }
    }

    /// The narrowest scope that holds every name that fits.
    pub(crate) fn scope(&self) -> Scope<'_> {
        let Parsed { text, level, fixed, key, .. } = &*self.0;
        Scope { level: *level, text: text.get(..*fixed).unwrap_or(text), key: *key }
    }
}

fn is_star(chunk: &str) -> bool {
    chunk == "*" || chunk == "**"
}

/// The scope that the chunks before the first star fix.
fn fixed_part(pattern: &str) -> Scope<'_> {
    match pattern.split('/').take_while(|chunk| !is_star(chunk)).count() {
        0 => Scope::ANY,
        1 => Scope::new(Level::Root, leading_chunks(pattern, 1)),
        _ => Scope::new(Level::Home, leading_chunks(pattern, 2)),
    }
}

fn chunks_match(pattern: &str, name: &str) -> bool {
    covers(pattern, name, |wide, chunk| wide == "*" || wide == chunk)
}

/// Whether all names of the pattern `inner` are names of `outer`.
fn chunks_within(inner: &str, outer: &str) -> bool {
    covers(outer, inner, |wide, narrow| narrow != "**" && (wide == "*" || wide == narrow))
}

/// Whether the chunks of `text` are those of `pattern`, one `fits` one, and any number of them each `**`.
///
/// Of several ways to share out chunks among the `**`, the one that gives each as few as it can do with is as good as
/// any: so only the last one is ever given more, and no more is tried than the product of both.
fn covers(pattern: &str, text: &str, fits: impl Fn(&str, &str) -> bool) -> bool {
    let (mut pattern, mut text) = (Some(pattern), Some(text));
    // What comes behind the last `**`, and the text that it has not been given yet.
    let mut last: Option<(Option<&str>, Option<&str>)> = None;
    loop {
        let wide = pattern.map(split_chunk);
        match (wide, text.map(split_chunk)) {
            (Some(("**", rest)), _) => {
                pattern = rest;
                last = Some((rest, text));
                continue;
            }
            (Some((wide, wide_rest)), Some((chunk, rest))) if fits(wide, chunk) => {
                (pattern, text) = (wide_rest, rest);
                continue;
            }
            (None, None) => return true,
            _ => {}
        }
        let Some((behind, Some(left))) = last else { return false };
        let left = split_chunk(left).1;
        last = Some((behind, left));
        (pattern, text) = (behind, left);
    }
}

/// Whether some name may fit both patterns; both sides lose chunks from the left.
fn chunks_meet(a: Option<&str>, b: Option<&str>) -> bool {
    let (Some(left), Some(right)) = (a, b) else {
        let rest = a.or(b);
        return rest.is_none_or(|rest| rest.split('/').all(|chunk| chunk == "**"));
    };
    let ((left, left_rest), (right, right_rest)) = (split_chunk(left), split_chunk(right));
    if left == "**" || right == "**" {
        return true;
    }
    (left == "*" || right == "*" || left == right) && chunks_meet(left_rest, right_rest)
}

fn split_chunk(text: &str) -> (&str, Option<&str>) {
    text.split_once('/').map_or((text, None), |(chunk, rest)| (chunk, Some(rest)))
}

impl From<&str> for Pattern {
    fn from(text: &str) -> Self {
        Self::new(text)
    }
}

impl PartialEq for Pattern {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || (self.0.wild == other.0.wild && self.0.text == other.0.text)
    }
}

impl Eq for Pattern {}

impl Hash for Pattern {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.text.hash(state);
        self.0.wild.hash(state);
    }
}

impl fmt::Display for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.text)
    }
}

impl fmt::Debug for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::Pattern;

    #[test]
    fn stars_stand_for_whole_chunks() {
        let fits = |pattern: &str, name: &str| Pattern::new(pattern).matches(name);
        assert!(fits("a/b", "a/b"));
        assert!(!fits("a/b", "a/b/c"));
        assert!(fits("*/b", "a/b"));
        assert!(!fits("a*", "ab"));
        assert!(fits("**", "a/b/c"));
        assert!(fits("a/**", "a"));
        assert!(fits("a/**/z", "a/b/c/z"));
        assert!(fits("a/**/z", "a/z"));
        assert!(!fits("a/**/z", "a/b/y"));
        assert!(!fits("*", "a/b"));
    }

    #[test]
    fn many_stars_are_matched_in_no_time() {
        let (stars, name) = ("**/a/".repeat(60) + "**/b", "a/".repeat(200) + "c");
        assert!(!Pattern::new(&*stars).matches(&name));
        assert!(Pattern::new(&*stars).matches(&(name + "/b")));
        assert!(!Pattern::new("a/".repeat(200) + "c").is_within(&Pattern::new(&*stars)));
        assert!(!Pattern::new("**/a/".repeat(60) + "c").is_within(&Pattern::new(stars)));
    }

    #[test]
    fn a_literal_pattern_takes_stars_as_they_are() {
        assert!(Pattern::literal("a/*").matches("a/*"));
        assert!(!Pattern::literal("a/*").matches("a/b"));
    }
}

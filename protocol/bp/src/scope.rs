//! Name scopes: the coarsest useful answer to "which events may this set hold?".
//!
//! A scope is a claim about names only. It indexes waiters and blockers, tells which homes a set may concern, and finds
//! what `explain` should show. A set's scopes may claim too much, never too little.

/// The part of an event's name that a scope fixes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    /// Nothing: any event.
    Any,
    /// The first chunk: `uav` in `uav/3/takeoff`.
    Root,
    /// The first two chunks: `uav/3`.
    Home,
    /// The whole name.
    Name,
}

/// A level and the part of a name it fixes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Scope<'a> {
    pub(crate) level: Level,
    pub(crate) text: &'a str,
    /// The hash under which an index files the scope.
    pub(crate) key: u64,
}

impl<'a> Scope<'a> {
    /// The scope that every event is in.
    pub(crate) const ANY: Scope<'static> = Scope { level: Level::Any, text: "", key: 0 };

    pub(crate) fn new(level: Level, text: &'a str) -> Self {
        let hash = text.bytes().fold(FNV_OFFSET, fnv);
        Self { level, text, key: key_of(level, hash) }
    }

    /// The scope of one name, with its key already known.
    pub(crate) fn name(text: &'a str, keys: &NameKeys) -> Self {
        Self { level: Level::Name, text, key: keys.name }
    }

    /// The narrowest scope of every name that starts with `prefix`, chunk borders or not.
    pub(crate) fn starting_with(prefix: &'a str) -> Self {
        let mut borders = prefix.match_indices('/').map(|(at, _)| at);
        let (root, home) = (borders.next(), borders.next());
        match (root, home) {
            (_, Some(end)) => Self::new(Level::Home, prefix.get(..end).unwrap_or_default()),
            (Some(end), None) => Self::new(Level::Root, prefix.get(..end).unwrap_or_default()),
            (None, _) => Self::ANY,
        }
    }

    /// Whether some name may be in both scopes.
    pub(crate) fn overlaps(&self, other: &Scope<'_>) -> bool {
        let (wide, narrow) = if self.level <= other.level { (self, other) } else { (other, self) };
        match wide.level {
            Level::Any => true,
            Level::Root => wide.text == leading_chunks(narrow.text, 1),
            Level::Home => wide.text == leading_chunks(narrow.text, 2),
            Level::Name => wide.text == narrow.text,
        }
    }
}

/// The first `count` chunks of a name, or all of it when it has fewer.
pub(crate) fn leading_chunks(name: &str, count: usize) -> &str {
    let end = name.match_indices('/').nth(count.saturating_sub(1)).map_or(name.len(), |(at, _)| at);
    name.get(..end).unwrap_or(name)
}

/// The index keys of one name at every level, computed in one pass when an event is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NameKeys {
    pub(crate) root: u64,
    pub(crate) home: u64,
    pub(crate) name: u64,
}

impl NameKeys {
    pub(crate) fn of(name: &str) -> Self {
        let (mut root, mut home) = (None, None);
        let mut hash = FNV_OFFSET;
        for byte in name.bytes() {
            if byte == b'/' {
                if root.is_none() {
                    root = Some(hash);
                } else if home.is_none() {
                    home = Some(hash);
                }
            }
            hash = fnv(hash, byte);
        }
        Self {
            root: key_of(Level::Root, root.unwrap_or(hash)),
            home: key_of(Level::Home, home.unwrap_or(hash)),
            name: key_of(Level::Name, hash),
        }
    }
}

/// FNV-1a, because it can be read off at every chunk border of a name, and is the same on every machine.
fn fnv(hash: u64, byte: u8) -> u64 {
    (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
}

const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;

/// Keeps the levels apart, since `uav/3` may be a name and a home at once.
fn key_of(level: Level, hash: u64) -> u64 {
    hash ^ (level as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_names_keys_are_the_keys_of_its_scopes() {
        for name in ["a", "uav/3", "uav/3/takeoff", "uav/3/a/b", "", "/", "a//b"] {
            let keys = NameKeys::of(name);
            assert_eq!(keys.root, Scope::new(Level::Root, leading_chunks(name, 1)).key, "{name}");
            assert_eq!(keys.home, Scope::new(Level::Home, leading_chunks(name, 2)).key, "{name}");
            assert_eq!(keys.name, Scope::new(Level::Name, name).key, "{name}");
        }
    }

    #[test]
    fn a_prefix_fixes_only_whole_chunks() {
        assert_eq!(Scope::starting_with("Enter"), Scope::ANY);
        assert_eq!(Scope::starting_with("uav/3"), Scope::new(Level::Root, "uav"));
        assert_eq!(Scope::starting_with("uav/3/t"), Scope::new(Level::Home, "uav/3"));
    }

    #[test]
    fn scopes_overlap_when_a_name_may_be_in_both() {
        let home = Scope::new(Level::Home, "uav/3");
        assert!(home.overlaps(&Scope::new(Level::Name, "uav/3/land")));
        assert!(home.overlaps(&Scope::new(Level::Name, "uav/3")));
        assert!(!home.overlaps(&Scope::new(Level::Name, "uav/31/land")));
        assert!(home.overlaps(&Scope::new(Level::Root, "uav")));
        assert!(!home.overlaps(&Scope::new(Level::Root, "ground")));
        assert!(Scope::ANY.overlaps(&home));
    }
}

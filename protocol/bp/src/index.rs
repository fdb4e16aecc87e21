//! An index of b-threads by the names in their event sets: those that an event may concern.

use std::collections::hash_map::Entry;

use rustc_hash::FxHashMap;

use crate::event::Event;
use crate::event_set::EventSet;
use crate::scope::{Level, Scope};

/// Position of a b-thread in its program.
pub(crate) type Place = u32;

/// A multimap from name scopes to b-threads.
///
/// It finds candidates: every b-thread that was filed under a set that holds the event, and perhaps others, since only
/// names are looked at and hashes may collide. The caller asks the sets themselves.
#[derive(Clone, Debug, Default)]
pub(crate) struct Index {
    /// Places under each scope's key, sorted; a place filed twice is there twice.
    filed: FxHashMap<u64, Vec<Place>>,
    any: Vec<Place>,
    homes: usize,
    roots: usize,
    /// Lists in `filed` that are empty, kept because names come back.
    empty: usize,
}

impl Index {
    pub(crate) fn file(&mut self, set: &EventSet, place: Place) {
        set.scopes().into_iter().for_each(|scope| self.file_scope(scope, place));
    }

    pub(crate) fn unfile(&mut self, set: &EventSet, place: Place) {
        set.scopes().into_iter().for_each(|scope| self.unfile_scope(scope, place));
        self.sweep();
    }

    pub(crate) fn file_event(&mut self, event: &Event, place: Place) {
        self.file_scope(Scope::name(event.name(), event.keys()), place);
    }

    pub(crate) fn unfile_event(&mut self, event: &Event, place: Place) {
        self.unfile_scope(Scope::name(event.name(), event.keys()), place);
        self.sweep();
    }

    /// The candidates for `event`, in lists; a place may come more than once.
    pub(crate) fn candidates(&self, event: &Event) -> [&[Place]; 4] {
        let keys = event.keys();
        // Most programs use no scope between a whole name and none.
        let under = |key: u64, filed: usize| -> &[Place] {
            if filed == 0 { &[] } else { self.filed.get(&key).map_or(&[], Vec::as_slice) }
        };
        [
            &self.any,
            under(keys.root, self.roots),
            under(keys.home, self.homes),
            under(keys.name, self.filed.len()),
        ]
    }

    fn file_scope(&mut self, scope: Scope<'_>, place: Place) {
        let list = match scope.level {
            Level::Any => &mut self.any,
            _ => match self.filed.entry(scope.key) {
                Entry::Vacant(vacant) => vacant.insert(Vec::new()),
                Entry::Occupied(occupied) => {
                    let list = occupied.into_mut();
                    self.empty -= usize::from(list.is_empty());
                    list
                }
            },
        };
        let at = list.partition_point(|filed| *filed <= place);
        list.insert(at, place);
        self.count(scope.level, 1);
    }

    fn unfile_scope(&mut self, scope: Scope<'_>, place: Place) {
        let list = match scope.level {
            Level::Any => Some(&mut self.any),
            _ => self.filed.get_mut(&scope.key),
        };
        let Some(list) = list else { return };
        let Ok(at) = list.binary_search(&place) else { return };
        list.remove(at);
        if list.is_empty() && scope.level != Level::Any {
            self.empty += 1;
        }
        self.count(scope.level, -1);
    }

    fn count(&mut self, level: Level, change: isize) {
        match level {
            Level::Root => self.roots = self.roots.saturating_add_signed(change),
            Level::Home => self.homes = self.homes.saturating_add_signed(change),
            Level::Any | Level::Name => {}
        }
    }

    /// Forgets empty lists once they are many and most, so that ever-new names cannot fill the memory.
    fn sweep(&mut self) {
        if self.empty > 256 && self.empty * 2 > self.filed.len() {
            self.filed.retain(|_, list| !list.is_empty());
            self.empty = 0;
        }
    }
}

//! The zones that others have drawn for this vehicle: what they block here, read.

use skein_dbp::{Node, NodeName};
use skein_wire::event::{Text, ZoneNews, ZoneState};
use skein_wire::{UnfitZone, Zone};

/// What one node draws counts up to twice what a station draws: what a former life of it has left may be among it.
const MOST: usize = 2 * Zone::MOST;
const MOST_CORNERS: usize = 2 * Zone::MOST_CORNERS_IN_ALL;

/// The zones of all other nodes.
#[derive(Debug, Default)]
pub struct DrawnZones {
    /// As they are written, each with whose it is.
    texts: Vec<(NodeName, Text)>,
    /// Those that can be read, likewise.
    zones: Vec<(NodeName, Zone)>,
    unreadable: Option<String>,
}

impl DrawnZones {
    /// Reads them anew, if what others block has changed; gives what is news then.
    pub fn read(&mut self, node: &Node) -> Option<Vec<ZoneNews>> {
        let me = node.name().as_str();
        let blocks = node.blocks_from_afar();
        let texts: Vec<(NodeName, Text)> = blocks
            .flat_map(|(of, _, block)| Zone::texts_in(block, me).into_iter().map(|text| (of.clone(), text)))
            .collect();
        if texts == self.texts {
            return None;
        }
        self.texts = texts;
        let before = std::mem::take(&mut self.zones);
        (self.zones, self.unreadable) = read(&self.texts);
        let news = |(of, zone): &(NodeName, Zone), state| ZoneNews {
            name: zone.name().into(),
            state,
            of: Some(of.as_str().into()),
        };
        let is_of = |zones: &[(NodeName, Zone)], (of, zone): &(NodeName, Zone)| {
            zones.iter().any(|(other, drawn)| other == of && drawn.name() == zone.name())
        };
        let gone = before.iter().filter(|zone| !is_of(&self.zones, zone));
        let new = self.zones.iter().filter(|zone| !before.contains(zone));
        let gone = gone.map(|zone| news(zone, ZoneState::Removed));
        Some(gone.chain(new.map(|zone| news(zone, ZoneState::Regarded))).collect())
    }

    pub fn zones(&self) -> impl Iterator<Item = &Zone> {
        self.zones.iter().map(|(_, zone)| zone)
    }

    /// Whose zones cannot be read, if somebody's cannot, and why: who does not know where it may not fly holds.
    pub fn unreadable(&self) -> Option<&str> {
        self.unreadable.as_deref()
    }
}

fn read(texts: &[(NodeName, Text)]) -> (Vec<(NodeName, Zone)>, Option<String>) {
    let (mut zones, mut unreadable) = (Vec::<(NodeName, Zone)>::new(), None);
    for (of, text) in texts {
        let parsed: Result<Zone, UnfitZone> = text.parse();
        match parsed {
            Ok(zone) => {
                let others = || zones.iter().filter(|(other, _)| other == of);
                let corners: usize = others().map(|(_, zone)| zone.corners()).sum();
                if others().count() < MOST && corners + zone.corners() <= MOST_CORNERS {
                    zones.push((of.clone(), zone));
                } else {
                    unreadable =
                        Some(format!("{of} draws more than {MOST} zones, or {MOST_CORNERS} corners"));
                }
            }
            Err(error) => unreadable = Some(format!("a zone of {of}: {error}")),
        }
    }
    (zones, unreadable)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(of: &str, zones: impl IntoIterator<Item = String>) -> Vec<(NodeName, Text)> {
        let of = NodeName::new(of).unwrap();
        zones.into_iter().map(|text| (of.clone(), text.as_str().into())).collect()
    }

    fn numbered(number: usize) -> String {
        format!(r#"{{"name":"z{number}","kind":"no_fly","centre_m":[0,0],"radius_m":5}}"#)
    }

    #[test]
    fn what_cannot_be_read_is_told_and_the_rest_counts() {
        let odd =
            texts("ground/main", [numbered(1), r#"{"name":"moat","kind":"moat"}"#.to_owned(), numbered(2)]);
        let (zones, unreadable) = read(&odd);
        assert_eq!(zones.iter().map(|(_, zone)| zone.name()).collect::<Vec<_>>(), ["z1", "z2"]);
        assert!(unreadable.unwrap().starts_with("a zone of ground/main: no zone: unknown variant `moat`"));
    }

    #[test]
    fn one_node_has_so_many_zones_and_corners_and_another_its_own() {
        let mut many = texts("ground/main", (0..MOST).map(numbered));
        many.extend(texts("ground/spare", [numbered(1)]));
        assert_eq!((read(&many).0.len(), read(&many).1), (MOST + 1, None));
        many.extend(texts("ground/main", [numbered(MOST)]));
        let (zones, unreadable) = read(&many);
        assert!(zones.len() == MOST + 1 && unreadable.unwrap().contains("more than 64 zones"));
        let corners: Vec<_> = (0..64).map(|k| [k, k * k]).collect();
        let cornered =
            |number: usize| format!(r#"{{"name":"c{number}","kind":"no_fly","corners_m":{corners:?}}}"#);
        assert_eq!(read(&texts("ground/main", (0..16).map(cornered))).1, None);
        assert!(read(&texts("ground/main", (0..17).map(cornered))).1.unwrap().contains("1024 corners"));
    }
}

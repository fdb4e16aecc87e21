//! What the decoders have let through, held against the bounds.

use skein_bp::script::Assignment;
use skein_bp::{Bid, Bound, Event, EventSet};
use skein_dbp::Message;
use skein_wire::event::{Declared as _, Load};
use skein_wire::{Payload, State};

/// Whether something in a message that was decoded is beyond a bound: the bound, and how much of it there is.
pub fn beyond(payload: &Payload) -> Option<(Bound, f64)> {
    let mut found = Finding(None);
    found.payload(payload);
    found.0
}

struct Finding(Option<(Bound, f64)>);

impl Finding {
    fn count(&mut self, bound: Bound, given: usize) {
        self.real(bound, given as f64);
    }

    fn real(&mut self, bound: Bound, given: f64) {
        if given > bound.stated() as f64 {
            self.0 = Some((bound, given));
        }
    }

    fn payload(&mut self, payload: &Payload) {
        match payload {
            Payload::Message(message) => self.message(message),
            Payload::State(state) => self.state(state.clone()),
            Payload::Board(board) => {
                for row in &board.rows {
                    [&row.waits, &row.blocks, &row.interrupts].into_iter().for_each(|set| self.set(set));
                }
            }
            Payload::Readiness(readiness) => {
                readiness.home.iter().for_each(|place| self.real(Bound::PlaceMetres, place.abs()));
                for check in &readiness.checks {
                    self.count(Bound::TextBytes, check.value.len());
                }
            }
            Payload::Scan(_) | Payload::Scene(_) => {}
        }
    }

    fn message(&mut self, message: &Message) {
        match message {
            Message::Bid(record) => {
                self.count(Bound::RecordBids, record.bids.len());
                self.count(Bound::RecordRequests, record.bids.iter().map(|bid| bid.requests.len()).sum());
                let blocks =
                    record.bids.iter().map(|bid| &bid.block).filter(|block| **block != EventSet::None);
                self.count(Bound::RecordNodes, blocks.clone().map(|block| block.extent().nodes).sum());
                blocks.for_each(|block| self.count(Bound::AskedDepth, block.extent().depth));
                for bid in &record.bids {
                    self.count(Bound::NameBytes, bid.bthread.len());
                    bid.requests.iter().for_each(|event| self.event(event));
                    self.set(&bid.block);
                }
            }
            Message::Ack(ack) => self.count(Bound::ListItems, ack.refused.len()),
            Message::Occurrence(occurrence) => {
                self.count(Bound::NamesServed, occurrence.requests_served.len());
                self.count(Bound::NamesServed, occurrence.requested_by.len());
                self.event(&occurrence.event);
            }
            Message::Repair(_) | Message::Presence(_) => {}
        }
    }

    fn state(&mut self, mut state: State) {
        state.position.iter().for_each(|place| self.real(Bound::PlaceMetres, place.abs()));
        [&state.mode, &state.task, &state.waiting_for, &state.holder, &state.asked_by]
            .into_iter()
            .for_each(|text| self.count(Bound::TextBytes, text.len()));
        state.bring_to_what_is_believed();
        self.real(Bound::RadiusMetres, state.radius_m);
        self.real(Bound::SigmaMetres, state.position_sigma_m);
        // A length that is cut may be longer by the last digit.
        self.real(Bound::SpeedMetresPerSecond, state.velocity.norm() - 1e-6);
    }

    fn set(&mut self, set: &EventSet) {
        let extent = set.extent();
        self.count(Bound::SetDepth, extent.depth);
        self.count(Bound::SetNodes, extent.nodes);
        self.inside(set);
    }

    fn inside(&mut self, set: &EventSet) {
        match set {
            EventSet::None | EventSet::All | EventSet::Region { .. } => {}
            EventSet::Exactly(event) => self.event(event),
            EventSet::Named(pattern) => self.name(pattern.as_str()),
            EventSet::Prefix(text) | EventSet::FieldRange { key: text, .. } => {
                self.count(Bound::NameBytes, text.len())
            }
            EventSet::FieldIs(fields) => {
                self.count(Bound::EventFields, fields.len());
                fields.keys().for_each(|key| self.count(Bound::NameBytes, key.len()));
            }
            EventSet::Not(set) => self.inside(set),
            EventSet::And(sets) | EventSet::Or(sets) => sets.iter().for_each(|set| self.inside(set)),
        }
    }

    fn name(&mut self, name: &str) {
        self.count(Bound::NameBytes, name.len());
        self.count(Bound::NameChunks, name.split('/').count());
    }

    fn event(&mut self, event: &Event) {
        if event.kind() == Load::NAME
            && let Some(text) = event.text("script")
        {
            self.script(text);
        }
        self.name(event.name());
        self.count(Bound::EventFields, event.data().len());
        let data = event.data().map(|(key, value)| key.len() + value.as_text().map_or(0, |text| text.len()));
        self.count(Bound::EventBytes, event.name().len() + data.sum::<usize>());
    }

    /// A script that its reader lets through, as a vehicle binds and tries it.
    fn script(&mut self, text: &str) {
        let Ok(assignment) = Assignment::from_json(text) else { return };
        let Ok(script) = assignment.bind("uav/1").map(|bound| bound.bthread) else { return };
        let bids = || script.bids();
        let sets = bids().flat_map(|bid| [bid.waits(), bid.blocks(), bid.interrupts()]);
        self.count(Bound::ScriptNodes, sets.map(|set| set.extent().nodes).sum());
        let texts = bids().flat_map(Bid::requests).flat_map(Event::data);
        self.count(
            Bound::ScriptBytes,
            texts.map(|(_, value)| value.as_text().map_or(0, |text| text.len())).sum(),
        );
        self.count(Bound::ScriptEvents, script.listened_to().len().max(script.blocked().len()));
    }
}

#[cfg(test)]
mod tests {
    use skein_wire::NodeName;

    use super::*;

    #[test]
    fn a_text_beyond_its_bound_is_found() {
        let state = State::new(NodeName::new("uav/1").unwrap());
        let worded = |bytes: usize| Payload::State(State { task: "w".repeat(bytes), ..state.clone() });
        let most = Bound::TextBytes.stated();
        assert_eq!(beyond(&worded(most)), None);
        assert_eq!(beyond(&worded(most + 1)), Some((Bound::TextBytes, (most + 1) as f64)));
    }
}

//! The heading of a message: the keys that it travels under, and who may say it.

use skein_bp::Bound;
use skein_dbp::NodeName;

/// A message between nodes.
pub trait Record {
    /// The keys that it travels under.
    const KIND: Kind;

    /// The node that alone may say this; none if that is whichever node the key names.
    fn sender(&self) -> Option<&NodeName>;

    /// The one node that this is for; none if that is whichever node the key names, or all.
    fn recipient(&self) -> Option<&NodeName> {
        None
    }
}

/// A kind of message. Its keys are `skein/<fleet>/<word>/<sender>`, and `.../<recipient>` where they are for one node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Kind {
    pub word: &'static str,
    pub addressee: Addressee,
    /// Every node listens to those that are for it or for all. If not, only those listen who ask for them.
    pub every_node_listens: bool,
    /// The bound on their length.
    pub bytes: Bound,
}

/// Whom a kind of message is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Addressee {
    All,
    One,
    AllOrOne,
}

impl Kind {
    pub const fn may_be_for_all(&self) -> bool {
        !matches!(self.addressee, Addressee::One)
    }

    pub const fn may_be_for_one(&self) -> bool {
        !matches!(self.addressee, Addressee::All)
    }
}
